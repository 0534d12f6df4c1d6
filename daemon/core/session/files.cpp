#include "daemon/core/session/files.hpp"

#include <fcntl.h>
#include <openssl/evp.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <iterator>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "drivers/box/reading.hpp"
#include "drivers/error.hpp"

namespace previz::session {
namespace {

[[noreturn]] void fail(const std::filesystem::path& file, const char* what) {
  throw Error(file.string() + ": " + what + ": " + std::strerror(errno));
}

}  // namespace

OpenFile::OpenFile(std::filesystem::path file, int flags)
    : file_(std::move(file)), descriptor_(::open(file_.c_str(), flags | O_CLOEXEC, 0666)) {
  if (!descriptor_) fail(file_, "cannot be opened");
}

void OpenFile::append(std::string_view text) const {
  while (!text.empty()) {
    const ssize_t written = ::write(get(), text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail(file_, "cannot be written");
    text.remove_prefix(static_cast<std::size_t>(written));
  }
}

void OpenFile::sync() const {
  if (::fdatasync(get()) != 0) fail(file_, "cannot be flushed to disk");
}

LineFile::LineFile(const std::filesystem::path& file)
    : file_(file, O_WRONLY | O_CREAT | O_EXCL | O_APPEND) {}

void sync_names(const std::filesystem::path& folder) {
  const OpenFile open(folder.empty() ? "." : folder, O_RDONLY | O_DIRECTORY);
  const bool is_synced = ::fsync(open.get()) == 0 || errno == EINVAL || errno == EROFS;
  if (!is_synced) fail(folder, "its entries cannot be flushed to disk");
}

void make_folders(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> missing;
  std::error_code failure;
  for (std::filesystem::path at = std::filesystem::absolute(folder).lexically_normal();
       !std::filesystem::exists(at, failure) && at.has_relative_path(); at = at.parent_path())
    missing.push_back(at);
  std::filesystem::create_directories(folder, failure);
  if (failure) throw Error(folder.string() + ": folder cannot be created: " + failure.message());
  for (const std::filesystem::path& made : missing) sync_names(made.parent_path());
}

bool lies_within(const std::filesystem::path& folder, const std::filesystem::path& file) {
  std::error_code unknown;
  const auto real_folder = std::filesystem::weakly_canonical(folder, unknown);
  if (unknown) return false;
  const auto real_file = std::filesystem::weakly_canonical(file, unknown);
  if (unknown) return false;
  // The path of a folder that ends in a slash has an empty last part.
  const auto last = real_folder.has_filename() ? real_folder.end() : std::prev(real_folder.end());
  return std::mismatch(real_folder.begin(), last, real_file.begin(), real_file.end()).first == last;
}

namespace {

std::string words_of_size(std::uint64_t bytes) {
  return bytes < 1 << 20 ? std::to_string(bytes >> 10) + " KiB"
                         : std::to_string(bytes >> 20) + " MiB";
}

std::string content_of(const OpenFile& file, const FileKind& kind) {
  const box::Reading reading(file.name());
  const auto check = [&](std::uint64_t bytes) {
    if (bytes > kind.most_bytes)
      throw Error(file.name().string() + ": is too large for " + std::string(kind.words) +
                  ", which has at most " + words_of_size(kind.most_bytes));
  };
  struct stat known {};
  if (::fstat(file.get(), &known) == 0) check(static_cast<std::uint64_t>(known.st_size));
  std::string content;
  content.reserve(static_cast<std::size_t>(known.st_size));
  std::vector<char> block(1 << 18);
  for (;;) {
    const ssize_t count = ::read(file.get(), block.data(), block.size());
    if (count == 0) return content;
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) fail(file.name(), "cannot be read");
    content.append(block.data(), static_cast<std::size_t>(count));
    check(content.size());
  }
}

std::string words_of(mode_t mode) {
  if (S_ISDIR(mode)) return "a folder";
  if (S_ISFIFO(mode)) return "a pipe";
  if (S_ISSOCK(mode)) return "a socket";
  return "a device";
}

OpenFile open_named_file(const std::filesystem::path& file, std::string_view what) {
  // Without O_NONBLOCK the opening of a pipe waits for somebody who writes.
  OpenFile open(file, O_RDONLY | O_NONBLOCK);
  struct stat known {};
  if (::fstat(open.get(), &known) == 0 && !S_ISREG(known.st_mode))
    throw Error(file.string() + ": is " + words_of(known.st_mode) + " and not " +
                std::string(what) +
                (S_ISFIFO(known.st_mode) ? "; write what comes through it to a file first" : ""));
  return open;
}

}  // namespace

std::string read_file(const std::filesystem::path& file, const FileKind& kind) {
  return content_of(open_named_file(file, kind.words), kind);
}

std::string read_beginning(const std::filesystem::path& file, std::size_t bytes) {
  const OpenFile open = open_named_file(file, "a file");
  std::string beginning(bytes, '\0');
  ssize_t count = 0;
  do count = ::read(open.get(), beginning.data(), bytes);
  while (count < 0 && errno == EINTR);
  if (count < 0) fail(file, "cannot be read");
  beginning.resize(static_cast<std::size_t>(count));
  return beginning;
}

std::string why_not_plain(const std::filesystem::path& file) {
  struct stat known {};
  if (::lstat(file.c_str(), &known) != 0)
    return errno == ENOENT || errno == ENOTDIR
               ? ""
               : std::string("cannot be looked at: ") + std::strerror(errno);
  if (S_ISREG(known.st_mode)) return "";
  if (!S_ISLNK(known.st_mode))
    return "is " + words_of(known.st_mode) + " and not a file, and is not opened";
  std::error_code unknown;
  return "is a link (to " + std::filesystem::read_symlink(file, unknown).string() +
         "), which is not followed; put the file itself there";
}

OpenFile open_plain_file(const std::filesystem::path& file) {
  // Without O_NONBLOCK the opening of a pipe waits for somebody who writes.
  OwnedDescriptor open(::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  struct stat known {};
  const bool is_plain = open && ::fstat(open.get(), &known) == 0 && S_ISREG(known.st_mode);
  const int error = errno;
  const std::string why_not = is_plain ? "" : why_not_plain(file);
  if (!why_not.empty()) throw Error(file.string() + ": " + why_not);
  errno = error;
  if (!is_plain) fail(file, "cannot be opened");
  return {std::move(open), file};
}

std::string read_plain_file(const std::filesystem::path& file, const FileKind& kind) {
  return content_of(open_plain_file(file), kind);
}

void PlainLines::read_more() {
  block_.erase(0, std::exchange(at_, 0));
  const std::size_t before = block_.size();
  block_.resize(before + (1 << 16));
  const ssize_t count = ::read(file_.get(), block_.data() + before, 1 << 16);
  block_.resize(before + static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
  if (count < 0 && errno != EINTR) fail(file_.name(), "cannot be read");
  has_ended_ = count == 0;
}

bool PlainLines::next(std::string& line) {
  std::size_t skipped = 0;
  for (std::size_t looked_at = at_;;) {
    const std::size_t end = block_.find('\n', looked_at);
    if (end != std::string::npos || has_ended_) {
      if (skipped == 0) line.assign(block_, at_, std::min(end, block_.size()) - at_);
      const bool is_there = end != std::string::npos || at_ < block_.size() || skipped > 0;
      at_ = end == std::string::npos ? block_.size() : end + 1;
      return is_there;
    }
    const std::size_t held = block_.size() - at_;
    if (held > most_bytes_a_line || skipped > 0) {
      if (skipped == 0) line.assign(block_, at_);
      skipped += held;
      at_ = block_.size();
      if (skipped > most_bytes_skipped) {
        has_ended_ = true;
        return true;
      }
    }
    looked_at = block_.size() - at_;
    read_more();
  }
}

void read_blocks(const std::filesystem::path& file, const std::function<bool()>& is_left,
                 const std::function<void(std::string_view)>& pass_on) {
  // Without O_NONBLOCK the opening of a pipe waits for somebody who writes.
  read_blocks(OpenFile(file, O_RDONLY | O_NONBLOCK), is_left, pass_on);
}

void read_blocks(const OpenFile& open, const std::function<bool()>& is_left,
                 const std::function<void(std::string_view)>& pass_on) {
  constexpr int patience_ms = 100;
  const std::filesystem::path& file = open.name();
  std::vector<char> block(1 << 20);
  for (;;) {
    if (is_left()) throw Error(file.string() + ": reading interrupted");
    pollfd waiting{open.get(), POLLIN, 0};
    if (::poll(&waiting, 1, patience_ms) == 0) continue;
    const ssize_t count = ::read(open.get(), block.data(), block.size());
    if (count == 0) return;
    if (count < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (count < 0) fail(file, "cannot be read");
    pass_on({block.data(), static_cast<std::size_t>(count)});
  }
}

struct Sha256::Context {
  EVP_MD_CTX* of_libcrypto = EVP_MD_CTX_new();
  Context() = default;
  ~Context() { EVP_MD_CTX_free(of_libcrypto); }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;

  static void check(bool good) {
    if (!good) throw Error("libcrypto cannot compute a SHA-256");
  }
};

Sha256::Sha256() : context_(std::make_unique<Context>()) {
  EVP_MD_CTX* const context = context_->of_libcrypto;
  Context::check(context && EVP_DigestInit_ex(context, EVP_sha256(), nullptr) == 1);
}

Sha256::~Sha256() = default;

void Sha256::add(std::string_view bytes) {
  Context::check(EVP_DigestUpdate(context_->of_libcrypto, bytes.data(), bytes.size()) == 1);
}

std::string Sha256::text() {
  constexpr char digits[] = "0123456789abcdef";
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  Context::check(EVP_DigestFinal_ex(context_->of_libcrypto, digest.data(), &size) == 1);
  std::string text;
  for (unsigned int i = 0; i < size; ++i) {
    text += digits[digest[i] >> 4];
    text += digits[digest[i] & 15];
  }
  return text;
}

std::string sha256_of(const std::filesystem::path& file, const std::stop_token& stop) {
  Sha256 hash;
  read_blocks(
      file, [&] { return stop.stop_requested(); },
      [&](std::string_view block) { hash.add(block); });
  return hash.text();
}

std::string base64(std::span<const std::byte> bytes) {
  std::string text(4 * ((bytes.size() + 2) / 3), '\0');
  EVP_EncodeBlock(reinterpret_cast<unsigned char*>(text.data()),
                  reinterpret_cast<const unsigned char*>(bytes.data()),
                  static_cast<int>(bytes.size()));
  return text;
}

std::string from_base64(const std::string& text) {
  constexpr std::size_t piece = 1u << 24;  // letters, of which four are three bytes
  std::string bytes(text.size() / 4 * 3, '\0');
  for (std::size_t at = 0; at < text.size(); at += piece) {
    const std::size_t count = std::min(piece, text.size() - at);
    if (EVP_DecodeBlock(reinterpret_cast<unsigned char*>(bytes.data()) + at / 4 * 3,
                        reinterpret_cast<const unsigned char*>(text.data()) + at,
                        static_cast<int>(count)) != static_cast<int>(count / 4 * 3) ||
        count % 4 != 0)
      throw std::invalid_argument("not base64");
  }
  // EVP_DecodeBlock counts the bytes that the padding stands for.
  std::size_t padding = 0;
  while (padding < 2 && padding < text.size() && text[text.size() - 1 - padding] == '=') ++padding;
  bytes.erase(bytes.size() - padding);
  return bytes;
}

}  // namespace previz::session
