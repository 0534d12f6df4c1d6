#include "daemon/tools/post/leases.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
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
// minute (farm::why_not_here()) where a client gives the times. Two of the signs may be late.
constexpr Seconds oldest_sign = Seconds(60) + Seconds(60) + 3 * between_signs;
// Nobody takes over any more what is so old while it is removed.
constexpr Seconds left_behind = 10 * oldest_sign;
constexpr Seconds for_another_to_tell(2);
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

std::optional<Seconds> age_of(const std::filesystem::path& file) {
  struct stat found {};
  if (::lstat(file.c_str(), &found) != 0) return std::nullopt;
  std::int64_t now_s = 0;
  try {
    now_s = time_of_disk_s(file.parent_path());
  } catch (const Error&) {
    now_s = std::time(nullptr);  // of a user who may not write in the folder
  }
  return Seconds(now_s - found.st_mtim.tv_sec);
}

}  // namespace

std::int64_t time_of_disk_s(const std::filesystem::path& folder) {
  const session::Draft draft(folder / "clock");
  struct stat made {};
  if (::fstat(draft.file().get(), &made) != 0)
    throw Error(folder.string() + ": its time cannot be read: " + std::strerror(errno));
  return made.st_mtim.tv_sec;
}

Leases::Leases(const std::filesystem::path& folder) : folder_(folder), name_(own_name()) {
  std::error_code code;
  std::filesystem::create_directory(folder, code);
  if (std::filesystem::symlink_status(folder).type() != std::filesystem::file_type::directory)
    throw Error(folder.string() + ": is a link, or cannot be created: " + code.message());
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
    const auto age = number_of(entry->path()) ? age_of(entry->path()) : std::nullopt;
    if (age && *age > left_behind) ::unlink(entry->path().c_str());
  }
  ::rmdir(folder_.c_str());  // where it is empty
}

// A sign that cannot be given is given the next time: the disk may be away for a moment.
void Leases::renew() {
  const std::lock_guard guard(mutex_);
  for (const std::uint64_t number : own_)
    static_cast<void>(::utimensat(AT_FDCWD, file(number).c_str(), nullptr, AT_SYMLINK_NOFOLLOW));
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
    if (made) throw Error(place.string() + ": cannot be written: " + std::strerror(errno));
    if (errno == EEXIST) return false;
    // The folder goes with the last lease in it.
    if (errno != ENOENT || (::mkdir(folder_.c_str(), 0777) != 0 && errno != EEXIST))
      throw Error(place.string() + ": cannot be created: " + std::strerror(errno));
  }
}

bool Leases::is_mine(std::uint64_t number) const {
  try {
    return session::read_plain_file(file(number), lease_kind) == name_;
  } catch (const Error&) {
    return false;
  }
}

// Nor is a file younger than now by more than that: clocks are not so wrong.
bool Leases::is_alive(const std::filesystem::path& file) const {
  const auto age = age_of(file);
  return age && std::chrono::abs(*age) < oldest_sign;
}

bool Leases::take(std::uint64_t number) {
  const std::lock_guard guard(mutex_);
  if (own_.contains(number)) return true;
  if (!make(number)) {
    if (is_alive(file(number))) return false;
    ::unlink(file(number).c_str());
    if (!make(number)) return false;
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

bool Leases::is_at_another(std::uint64_t number) const {
  const std::lock_guard guard(mutex_);
  return !own_.contains(number) && is_alive(file(number));
}

std::set<std::uint64_t> Leases::at_others(std::uint64_t begin, std::uint64_t end) const {
  const std::lock_guard guard(mutex_);
  std::set<std::uint64_t> numbers;
  std::error_code gone;
  for (std::filesystem::directory_iterator entry(folder_, gone), none; !gone && entry != none;
       entry.increment(gone)) {
    const auto number = number_of(entry->path());
    if (number && *number >= begin && *number < end && !own_.contains(*number) &&
        is_alive(entry->path()))
      numbers.insert(*number);
  }
  return numbers;
}

}  // namespace previz::post
