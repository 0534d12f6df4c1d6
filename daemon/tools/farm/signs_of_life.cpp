#include "daemon/tools/farm/signs_of_life.hpp"

#include <fcntl.h>
#include <sys/stat.h>

#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstring>
#include <ctime>
#include <mutex>
#include <stop_token>

#include "daemon/core/session/draft.hpp"
#include "drivers/error.hpp"

namespace previz::farm {
namespace {

using std::chrono::seconds;

// NFS may show a time that is old by a minute (acregmax in nfs(5)), and clocks may differ by a
// minute (why_not_here()) where a client gives the times. Two of the signs, which come every 20 s,
// may be late.
constexpr seconds oldest_sign = seconds(60) + seconds(60) + 3 * seconds(20);

void renew(const std::stop_token& stop, const std::filesystem::path& file,
           std::chrono::milliseconds between) {
  std::mutex mutex;
  std::unique_lock lock(mutex);
  std::condition_variable_any wake;
  // A sign that cannot be given is given the next time: the disk may be away for a moment.
  while (!wake.wait_for(lock, stop, between, [] { return false; }) && !stop.stop_requested())
    static_cast<void>(::utimensat(AT_FDCWD, file.c_str(), nullptr, AT_SYMLINK_NOFOLLOW));
}

// A user who may not write in the folder goes by the clock.
std::int64_t time_now_s(const std::filesystem::path& folder) {
  try {
    return time_of_disk_s(folder);
  } catch (const Error&) {
    return std::time(nullptr);
  }
}

}  // namespace

SignsOfLife::SignsOfLife(const std::filesystem::path& file, std::chrono::milliseconds between)
    : thread_([=](const std::stop_token& stop) { renew(stop, file, between); }) {}

std::int64_t time_of_disk_s(const std::filesystem::path& folder) {
  const session::Draft draft(folder / "clock");
  struct stat made {};
  if (::fstat(draft.file().get(), &made) != 0)
    throw Error(folder.string() + ": its time cannot be read: " + std::strerror(errno));
  return made.st_mtim.tv_sec;
}

bool has_signs_of_life(const std::filesystem::path& file) {
  struct stat found {};
  if (::lstat(file.c_str(), &found) != 0) return false;
  const std::int64_t age_s = time_now_s(file.parent_path()) - found.st_mtim.tv_sec;
  return std::chrono::abs(seconds(age_s)) < oldest_sign;
}

}  // namespace previz::farm
