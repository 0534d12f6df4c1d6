// Writes files that survive a crash, hashes their content, and writes bytes as text.
#pragma once

#include <cstddef>
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

// Returns the whole file; throws previz::Error naming it.
std::string read_file(const std::filesystem::path& file);

// Takes come from elsewhere: a link in one may lead anywhere, and a pipe or a device may keep its
// reader waiting for ever. Both open and read only what is a file itself, without waiting. Throw
// previz::Error that says what else is there.
OpenFile open_plain_file(const std::filesystem::path& file);
std::string read_plain_file(const std::filesystem::path& file);
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
