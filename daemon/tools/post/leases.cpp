#include "daemon/tools/post/leases.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <ctime>
#include <optional>
#include <stop_token>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::post {
namespace {

using Seconds = std::chrono::seconds;

constexpr Seconds between_signs(20);
// NFS may show a time that is old by a minute (acregmax in nfs(5)), and clocks may differ by a
// minute (farm::why_not_here()). Two of the signs may be late.
constexpr Seconds oldest_sign = Seconds(60) + Seconds(60) + 3 * between_signs;
// Nobody takes over any more what is so old while it is removed.
constexpr Seconds left_behind = 10 * oldest_sign;
constexpr Seconds for_another_to_tell(2);
// So many machines share no folder; what is beyond in one from elsewhere counts for nothing.
constexpr std::size_t most_leases = 10'000;
constexpr session::FileKind lease_kind{"a lease", 4096};

std::string own_name() {
  static std::atomic<unsigned> count;
  std::array<char, 256> host{};
  static_cast<void>(::gethostname(host.data(), host.size() - 1));
  return std::string(host.data()) + " " + std::to_string(::getpid()) + " " +
         std::to_string(++count);
}

std::optional<std::uint64_t> number_of(const std::filesystem::path& file) {
  const std::string name = file.filename().string();
  std::uint64_t number = 0;
  const auto [end, code] = std::from_chars(name.data(), name.data() + name.size(), number);
  if (code != std::errc() || end != name.data() + name.size()) return std::nullopt;
  return number;
}

Seconds age_of(const struct stat& found, std::int64_t behind_s) {
  return Seconds(std::time(nullptr) + behind_s - found.st_mtim.tv_sec);
}

// A file of the future is one of a clock that is wrong, and no sign.
bool is_alive(const struct stat& found, std::int64_t behind_s) {
  return std::chrono::abs(age_of(found, behind_s)) < oldest_sign;
}

}  // namespace

std::int64_t time_of_disk_s(const std::filesystem::path& folder) {
  const session::Draft draft(folder / "clock");
  struct stat made {};
  if (::fstat(draft.file().get(), &made) != 0)
    throw Error(folder.string() + ": its time cannot be read: " + std::strerror(errno));
  return made.st_mtim.tv_sec;
}

std::set<std::uint64_t> leased(const std::filesystem::path& folder, std::uint64_t begin,
                               std::uint64_t end, std::int64_t behind_s) {
  std::set<std::uint64_t> numbers;
  std::size_t looked_at = 0;
  std::error_code gone;
  for (std::filesystem::directory_iterator entry(folder, gone), none;
       !gone && entry != none && ++looked_at < most_leases; entry.increment(gone)) {
    struct stat found {};
    const auto number = number_of(entry->path());
    if (number && *number >= begin && *number < end &&
        ::lstat(entry->path().c_str(), &found) == 0 && is_alive(found, behind_s))
      numbers.insert(*number);
  }
  return numbers;
}

Leases::Leases(const std::filesystem::path& folder) : folder_(folder), name_(own_name()) {
  std::error_code code;
  std::filesystem::create_directory(folder, code);
  if (std::filesystem::symlink_status(folder).type() != std::filesystem::file_type::directory)
    throw Error(folder.string() + ": is a link, or cannot be created: " + code.message());
  behind_s_ = time_of_disk_s(folder) - std::time(nullptr);
  signs_ = std::jthread([this](const std::stop_token& stop) {
    std::mutex mutex;
    std::unique_lock lock(mutex);
    std::condition_variable_any wake;
    while (!wake.wait_for(lock, stop, between_signs, [] { return false; }) &&
           !stop.stop_requested())
      renew();
  });
}

Leases::~Leases() {
  signs_ = {};
  while (!own_.empty()) give_back(*own_.begin());
  std::error_code gone;
  for (std::filesystem::directory_iterator entry(folder_, gone), end; !gone && entry != end;
       entry.increment(gone)) {
    struct stat found {};
    if (number_of(entry->path()) && ::lstat(entry->path().c_str(), &found) == 0 &&
        age_of(found, behind_s_) > left_behind)
      ::unlink(entry->path().c_str());
  }
  session::remove_dead_drafts(folder_);  // of whoever died while it looked for the time
  ::rmdir(folder_.c_str());              // where it is empty
}

// A sign that cannot be given is given the next time: the disk may be away for a moment. What was
// taken over meanwhile, because this process stood still for minutes, is another's.
void Leases::renew() {
  const std::lock_guard guard(mutex_);
  std::erase_if(own_, [&](std::uint64_t number) {
    const bool is_there = ::access(file(number).c_str(), R_OK) == 0;
    if (is_there && !is_mine(number)) return true;
    static_cast<void>(::utimensat(AT_FDCWD, file(number).c_str(), nullptr, AT_SYMLINK_NOFOLLOW));
    return false;
  });
}

std::filesystem::path Leases::file(std::uint64_t number) const {
  return folder_ / std::to_string(number);
}

// Returns false if the file is there.
bool Leases::make(std::uint64_t number) const {
  const std::filesystem::path place = file(number);
  for (;;) {
    const OwnedDescriptor made(
        ::open(place.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666));
    if (made && ::write(made.get(), name_.data(), name_.size()) == std::ssize(name_)) return true;
    const int error = errno;
    if (made) ::unlink(place.c_str());
    if (!made && error == EEXIST) return false;
    // The folder goes with the last lease in it.
    if (made || error != ENOENT || (::mkdir(folder_.c_str(), 0777) != 0 && errno != EEXIST))
      throw Error(place.string() + ": cannot be created: " + std::strerror(error));
  }
}

bool Leases::is_mine(std::uint64_t number) const {
  try {
    return session::read_plain_file(file(number), lease_kind) == name_;
  } catch (const Error&) {
    return false;
  }
}

// Removes the file of a process that has died; returns false if it lives, or if another one has
// just removed it and made its own: what was taken away is then that, and is put back.
bool Leases::remove_dead(std::uint64_t number) const {
  struct stat dead {
  }, taken{};
  if (::lstat(file(number).c_str(), &dead) != 0 || is_alive(dead, behind_s_)) return false;
  std::string away = "away " + name_;
  std::ranges::replace(away, ' ', '-');
  const std::filesystem::path aside = folder_ / away;
  if (::rename(file(number).c_str(), aside.c_str()) != 0) return false;
  const bool is_the_same = ::lstat(aside.c_str(), &taken) == 0 && taken.st_ino == dead.st_ino &&
                           !is_alive(taken, behind_s_);
  // If a third process has made the file meanwhile, the one whose file this was will see that.
  std::error_code taken_again;
  if (!is_the_same) std::filesystem::create_hard_link(aside, file(number), taken_again);
  ::unlink(aside.c_str());
  return is_the_same;
}

bool Leases::take(std::uint64_t number) {
  const std::lock_guard guard(mutex_);
  if (own_.contains(number)) return true;
  if (!make(number)) {
    if (!remove_dead(number) || !make(number)) return false;
    std::this_thread::sleep_for(for_another_to_tell);
    if (!is_mine(number)) return false;
  }
  own_.insert(number);
  return true;
}

void Leases::give_back(std::uint64_t number) {
  const std::lock_guard guard(mutex_);
  if (own_.erase(number) > 0 && is_mine(number)) ::unlink(file(number).c_str());
}

}  // namespace previz::post
