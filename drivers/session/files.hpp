// Files that survive a crash, and their content hash.
#pragma once

#include <filesystem>
#include <string>

namespace previz::session {

// A file descriptor that closes itself.
class Descriptor {
 public:
  // Throws previz::Error naming the file. `flags` as for open(2), always with O_CLOEXEC.
  Descriptor(const std::filesystem::path& file, int flags);
  ~Descriptor();
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return descriptor_; }
  // Waits until what was written is on the medium; throws previz::Error.
  void sync() const;

 private:
  std::filesystem::path file_;
  int descriptor_;
};

// A text file that grows by whole lines; each is the kernel's as soon as append() returns.
class LineFile {
 public:
  explicit LineFile(const std::filesystem::path& file);
  void append(std::string line);  // adds the newline
  void sync() const { descriptor_.sync(); }

 private:
  std::filesystem::path file_;
  Descriptor descriptor_;
};

// Replaces the file's content at once: a crash leaves the old or the new, never a part.
void replace_file(const std::filesystem::path& file, const std::string& content);
// The whole file; throws previz::Error naming it.
std::string read_file(const std::filesystem::path& file);
// SHA-256 of the file's content, 64 lower-case hexadecimal digits.
std::string sha256_of(const std::filesystem::path& file);

}  // namespace previz::session
