#include "daemon/tools/post/folder_locks.hpp"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>
#include <utility>

#include "daemon/core/session/files.hpp"
#include "daemon/core/session/json_numbers.hpp"
#include "daemon/tools/post/mounts.hpp"
#include "drivers/error.hpp"

namespace previz::post {
namespace {

// The bytes that are locked; none of them needs to be in the file.
constexpr std::uint64_t transaction_byte = 0, first_frame_byte = 1;
constexpr std::uint64_t video_byte = std::uint64_t{1} << 61;       // above all frames
constexpr std::uint64_t first_line_byte = std::uint64_t{1} << 62;  // of the processes' lines
constexpr std::uint64_t frames_end = video_byte - first_frame_byte;
// The file has a few hundred bytes for each process that renders into the folder.
constexpr std::uint64_t most_lines = 4096;
constexpr std::size_t most_bytes = 1 << 20;
constexpr const char* leases_name = "render.leases";

struct flock range_of(std::uint64_t byte, short type) {
  struct flock range {};
  range.l_type = type;
  range.l_whence = SEEK_SET;
  range.l_start = static_cast<off_t>(byte);
  range.l_len = 1;
  return range;
}

std::string line_of(const FolderUser& user) {
  nlohmann::ordered_json json;
  json["host"] = user.host;
  json["pid"] = user.pid;
  json["since"] = user.since;
  json["frames"] = user.frames;
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

FolderUser user_of(const std::string& line) {
  try {
    const auto json = nlohmann::json::parse(line);
    FolderUser user;
    json.at("host").get_to(user.host);
    user.pid = session::number_at<std::int64_t>(json, "pid");
    json.at("since").get_to(user.since);
    for (const auto frame : session::numbers_of<std::uint64_t>(json.at("frames")))
      user.frames.insert(frame);
    return user;
  } catch (const std::exception&) {
    return {};  // half written when its process died, or changed by hand
  }
}

OwnedDescriptor open_lock_file(const std::filesystem::path& file) {
  const std::string why_not = session::why_not_plain(file);
  if (!why_not.empty()) throw Error(file.string() + ": " + why_not);
  OwnedDescriptor open(
      ::open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, 0666));
  if (!open) throw Error(file.string() + ": cannot be opened: " + std::strerror(errno));
  return open;
}

}  // namespace

std::string words_of(const FolderUser& user) {
  if (user.host.empty()) return "another process";
  return "previzd " + std::to_string(user.pid) + " on host " + user.host + ", since " + user.since;
}

std::string host_name() {
  if (const char* const node = std::getenv("SLURMD_NODENAME"); node && *node) return node;
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "unknown";
}

int call_fcntl(int descriptor, int command, struct flock* range) {
  return ::fcntl(descriptor, command, range);
}

FolderLocks::FolderLocks(const std::filesystem::path& file, OwnedDescriptor open, LockCall call)
    : file_(file), open_(std::move(open)), call_(call) {
  struct flock range = range_of(transaction_byte, F_WRLCK);
  has_locks_ = call_(open_.get(), F_OFD_GETLK, &range) == 0;
  std::string why;
  if (!has_locks_)
    why = std::string("the file system has no locks (") + std::strerror(errno) + ")";
  else if (const std::string kind = local_locks_of(file.parent_path()); !kind.empty())
    why = "the file system's locks hold on this machine only (" + kind + ")";
  if (!why.empty())
    missing_ = file.string() + ": " + why + ": machines know each other by files in " +
               leases_name + " beside it, and one that dies is replaced after three minutes";
}

FolderLocks::FolderLocks(const std::filesystem::path& folder, LockCall call)
    : FolderLocks(folder / file_name, open_lock_file(folder / file_name), call) {
  self_.host = host_name();
  self_.pid = ::getpid();
  self_.since = fmt::format("{:%Y-%m-%d %H:%M} UTC", fmt::gmtime(std::time(nullptr)));
  if (!missing_.empty()) leases_ = std::make_unique<Leases>(folder / leases_name);
  look_for_leases();
}

std::vector<FolderUser> users_of(const std::filesystem::path& folder, LockCall call) {
  const std::filesystem::path file = folder / FolderLocks::file_name;
  OwnedDescriptor open(::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (!open && (errno == ENOENT || errno == ESTALE)) return {};  // nobody was, or has ended
  if (!open) throw Error(file.string() + ": cannot be opened: " + std::strerror(errno));
  return FolderLocks(file, std::move(open), call).others();
}

// A machine whose locks are not seen by others may have come here since.
void FolderLocks::look_for_leases() {
  std::error_code unknown;
  const std::filesystem::path folder = file_.parent_path() / leases_name;
  if (!leases_ && std::filesystem::exists(std::filesystem::symlink_status(folder, unknown)))
    leases_ = std::make_unique<Leases>(folder);
}

FolderLocks::~FolderLocks() {
  if (line_ < 0) return;
  try {
    const Transaction transaction(*this);
    self_ = {};
    write_own_line();
  } catch (const std::exception&) {
    // The line stays; it counts for nothing, because its byte is no longer locked.
  }
}

FolderLocks::Transaction::Transaction(FolderLocks& locks, const std::stop_token& stop)
    : locks_(locks) {
  locks_.look_for_leases();
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::minutes patience(5);
  const Clock::time_point begin = Clock::now();
  while (!locks_.lock(transaction_byte)) {
    if (stop.stop_requested()) throw Error(locks_.file_.string() + ": interrupted");
    if (Clock::now() - begin > patience) {
      std::string who;
      for (const FolderUser& user : locks_.others()) add_to_list(who, words_of(user), "; ");
      throw Error(locks_.file_.string() +
                  ": has been locked for 5 minutes; one of these processes hangs, end it and start "
                  "the same command again: " +
                  who);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  try {
    if (locks_.leases_) locks_.see_others();
  } catch (...) {
    locks_.unlock(transaction_byte);
    throw;
  }
}

// What this process has is told by a lease as well, once somebody needs it.
void FolderLocks::see_others() {
  if (line_ >= 0 && !leases_->take(first_line_byte + static_cast<std::uint64_t>(line_))) {
    unlock(first_line_byte + static_cast<std::uint64_t>(line_));
    join();
  }
  at_others_.clear();
  for (const FolderUser& user : others()) at_others_.insert(user.frames.begin(), user.frames.end());
}

FolderLocks::Transaction::~Transaction() {
  locks_.unlock(transaction_byte);
}

bool FolderLocks::lock(std::uint64_t byte) {
  if (leases_ && !leases_->take(byte)) return false;
  if (lock_in_file(byte)) return true;
  if (leases_) leases_->give_back(byte);
  return false;
}

bool FolderLocks::lock_in_file(std::uint64_t byte) {
  if (!has_locks_) return true;
  struct flock range = range_of(byte, F_WRLCK);
  while (call_(open_.get(), F_OFD_SETLK, &range) != 0) {
    if (errno == EAGAIN || errno == EACCES) return false;
    if (errno != EINTR) throw Error(file_.string() + ": cannot be locked: " + std::strerror(errno));
  }
  return true;
}

void FolderLocks::unlock(std::uint64_t byte) {
  if (leases_) leases_->give_back(byte);
  if (!has_locks_) return;
  struct flock range = range_of(byte, F_UNLCK);
  while (call_(open_.get(), F_OFD_SETLK, &range) != 0 && errno == EINTR) {
  }
}

bool FolderLocks::is_locked_by_another(std::uint64_t byte) const {
  if (!has_locks_) return false;
  struct flock range = range_of(byte, F_WRLCK);
  look_at(range);
  return range.l_type != F_UNLCK;
}

void FolderLocks::look_at(struct flock& range) const {
  while (call_(open_.get(), F_OFD_GETLK, &range) != 0)
    if (errno != EINTR)
      throw Error(file_.string() + ": its locks cannot be read: " + std::strerror(errno));
}

void FolderLocks::add_locked(std::uint64_t begin, std::uint64_t end,
                             std::set<std::uint64_t>& lines) const {
  if (begin >= end || lines.size() >= most_lines) return;
  struct flock range = range_of(begin, F_WRLCK);
  range.l_len = static_cast<off_t>(end - begin);
  look_at(range);
  if (range.l_type == F_UNLCK) return;
  // It is one of several, in no order.
  const std::uint64_t first = std::max(begin, static_cast<std::uint64_t>(range.l_start));
  const std::uint64_t last =
      range.l_len == 0 ? end : first + static_cast<std::uint64_t>(range.l_len);
  lines.insert(first - first_line_byte);
  add_locked(begin, first, lines);
  add_locked(last, end, lines);
}

std::set<std::uint64_t> FolderLocks::lines_of_others() const {
  std::set<std::uint64_t> lines;
  if (has_locks_) add_locked(first_line_byte, first_line_byte + most_lines, lines);
  for (const std::uint64_t byte :
       leased(file_.parent_path() / leases_name, first_line_byte, first_line_byte + most_lines,
              leases_ ? leases_->behind_s() : 0))
    lines.insert(byte - first_line_byte);
  if (line_ >= 0) lines.erase(static_cast<std::uint64_t>(line_));
  return lines;
}

std::vector<std::string> FolderLocks::lines() const {
  std::string text;
  std::array<char, 4096> block{};
  while (text.size() < most_bytes) {
    const ssize_t count =
        ::pread(open_.get(), block.data(), block.size(), static_cast<off_t>(text.size()));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw Error(file_.string() + ": cannot be read: " + std::strerror(errno));
    if (count == 0) break;
    text.append(block.data(), static_cast<std::size_t>(count));
  }
  std::vector<std::string> all;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) all.push_back(line);
  return all;
}

// Lines of processes that have ended become empty: the others keep their places.
void FolderLocks::write_own_line() {
  const std::vector<std::string> before = lines();
  std::map<std::uint64_t, std::string> all;
  for (const std::uint64_t i : lines_of_others()) all[i] = i < before.size() ? before[i] : "";
  if (!self_.host.empty()) all[static_cast<std::uint64_t>(line_)] = line_of(self_);
  std::string text;
  std::uint64_t next = 0;
  for (const auto& [i, line] : all) {
    text.append(i - next, '\n').append(line).append("\n");
    next = i + 1;
  }
  for (std::size_t done = 0; done < text.size();) {
    const ssize_t count =
        ::pwrite(open_.get(), text.data() + done, text.size() - done, static_cast<off_t>(done));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw Error(file_.string() + ": cannot be written: " + std::strerror(errno));
    done += static_cast<std::size_t>(count);
  }
  if (::ftruncate(open_.get(), static_cast<off_t>(text.size())) != 0)
    throw Error(file_.string() + ": cannot be cut: " + std::strerror(errno));
}

void FolderLocks::join() {
  std::int64_t line = 0;
  while (!lock(first_line_byte + static_cast<std::uint64_t>(line))) ++line;
  line_ = line;
  write_own_line();
}

std::vector<FolderUser> FolderLocks::others() const {
  std::vector<FolderUser> users;
  const std::vector<std::string> all = lines();
  for (const std::uint64_t i : lines_of_others())
    users.push_back(i < all.size() ? user_of(all[i]) : FolderUser{});
  return users;
}

std::set<std::uint64_t> FolderLocks::claim(const std::set<std::uint64_t>& frames,
                                           std::uint64_t most) {
  std::set<std::uint64_t> taken;
  for (const std::uint64_t frame : frames) {
    if (frame >= frames_end) throw Error("frame " + std::to_string(frame) + ": is not possible");
    if (taken.size() < most && !at_others_.contains(frame) &&
        lock_in_file(first_frame_byte + frame))
      taken.insert(frame);
  }
  self_.frames.insert(taken.begin(), taken.end());
  if (line_ >= 0 && !taken.empty()) write_own_line();
  return taken;
}

void FolderLocks::release(std::uint64_t frame) {
  if (self_.frames.erase(frame) == 0) return;
  unlock(first_frame_byte + frame);
  if (line_ >= 0) write_own_line();
}

bool FolderLocks::is_at_another(std::uint64_t frame) const {
  return at_others_.contains(frame) ||
         (frame < frames_end && is_locked_by_another(first_frame_byte + frame));
}

bool FolderLocks::claim_video() {
  return lock(video_byte);
}

}  // namespace previz::post
