// Writes files that survive a crash, hashes their content, and writes bytes as text.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>

#include "drivers/descriptor.hpp"

namespace previz::session {

class OpenFile {
 public:
  // Throws previz::Error naming the file. `flags` as for open(2), always with O_CLOEXEC.
  OpenFile(std::filesystem::path file, int flags);
  // Takes over what is open already; `name` is for errors.
  OpenFile(OwnedDescriptor open, std::filesystem::path name)
      : file_(std::move(name)), descriptor_(std::move(open)) {}
  int get() const { return descriptor_.get(); }
  const std::filesystem::path& name() const { return file_; }
  void append(std::string_view text) const;
  // Waits until what was written is on the medium; throws previz::Error.
  void sync() const;

 private:
  std::filesystem::path file_;
  OwnedDescriptor descriptor_;
};

// A text file that grows by whole lines; each line has reached the kernel when append() returns.
class LineFile {
 public:
  explicit LineFile(const std::filesystem::path& file);
  void append(const std::string& line) const { file_.append(line + '\n'); }
  void sync() const { file_.sync(); }

 private:
  OpenFile file_;
};

// Waits until the names in a folder are on the medium, as fsync(2) of a file does not. File systems
// that cannot do it need not. Throws previz::Error.
void sync_names(const std::filesystem::path& folder);
// Makes a folder and those above it that are missing; their names are then on the medium. Throws
// previz::Error.
void make_folders(const std::filesystem::path& folder);

// Returns whether a file, or the place of one that is not there, is inside the folder, wherever
// links on the way to it lead.
bool lies_within(const std::filesystem::path& folder, const std::filesystem::path& file);

// What a file is, for words, and the bytes that one of its kind can have. A file without content
// may claim any size, and has it all in memory once it is read.
struct FileKind {
  std::string_view words;  // "a set file"
  std::uint64_t most_bytes;
};

// Returns the whole of a file that a user names, which may be a link to one. A pipe or a device is
// not waited for. Throws previz::Error that says what is there instead, or how large it may be.
std::string read_file(const std::filesystem::path& file, const FileKind& kind);

// Returns so many bytes from the beginning of such a file, or all that it has. Throws likewise.
std::string read_beginning(const std::filesystem::path& file, std::size_t bytes);

// Takes come from elsewhere, and a link in one may lead anywhere. These open and read only what is
// a file itself.
OpenFile open_plain_file(const std::filesystem::path& file);
std::string read_plain_file(const std::filesystem::path& file, const FileKind& kind);

// Reads a file that is a file itself, line by line.
class PlainLines {
 public:
  // Throws previz::Error, as open_plain_file() does.
  explicit PlainLines(const std::filesystem::path& file) : file_(open_plain_file(file)) {}
  // Takes the next line, without its end; false behind the last one. Of a line longer than any
  // record can be, only the beginning is taken; one of 64 MiB ends the file. Throws previz::Error.
  bool next(std::string& line);

 private:
  void read_more();

  static constexpr std::size_t most_bytes_a_line = 1 << 20, most_bytes_skipped = 1 << 26;
  OpenFile file_;
  std::string block_;   // what was read
  std::size_t at_ = 0;  // of it was taken
  bool has_ended_ = false;
};
// Returns what is there in the place of a file, and what to do about it, as the end of a sentence
// that begins with its name; empty: a file, or nothing.
std::string why_not_plain(const std::filesystem::path& file);
// Passes the file's content on in blocks. `is_left` is asked between blocks, and a few times a
// second while a pipe has nothing; where it returns true, previz::Error ends the reading. Throws
// previz::Error naming the file.
void read_blocks(const std::filesystem::path& file, const std::function<bool()>& is_left,
                 const std::function<void(std::string_view)>& pass_on);
void read_blocks(const OpenFile& file, const std::function<bool()>& is_left,
                 const std::function<void(std::string_view)>& pass_on);

// Computes a SHA-256 of what comes in pieces.
class Sha256 {
 public:
  Sha256();  // throws previz::Error
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;
  void add(std::string_view bytes);
  std::string text();  // 64 lower-case hexadecimal digits; nothing can be added after it

 private:
  struct Context;
  const std::unique_ptr<Context> context_;
};

// Returns the SHA-256 of the file's content, 64 lower-case hexadecimal digits.
std::string sha256_of(const std::filesystem::path& file, const std::stop_token& stop = {});
// Base64 with padding, on one line (RFC 4648).
std::string base64(std::span<const std::byte> bytes);
// Returns the bytes of what base64() writes. Throws std::invalid_argument if it is nothing such.
std::string from_base64(const std::string& text);

}  // namespace previz::session
