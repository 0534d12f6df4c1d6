#include "daemon/farm/signs_of_life.hpp"

#include <fcntl.h>
#include <sys/stat.h>

#include <chrono>
#include <condition_variable>
#include <ctime>
#include <mutex>
#include <stop_token>

#include "drivers/error.hpp"
#include "drivers/session/draft.hpp"

namespace previz::farm {
namespace {

using std::chrono::seconds;

// NFS may show a time that is old by a minute (acregmax in nfs(5)), and clocks may differ by a
// minute (why_not_here()). Two of the signs, which come every 20 s, may be late.
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

}  // namespace

SignsOfLife::SignsOfLife(const std::filesystem::path& file, std::chrono::milliseconds between)
    : thread_([=](const std::stop_token& stop) { renew(stop, file, between); }) {}

bool has_signs_of_life(const std::filesystem::path& file) {
  struct stat found {
  }, now{};
  if (::lstat(file.c_str(), &found) != 0) return false;
  now.st_mtim.tv_sec = std::time(nullptr);
  try {
    const session::Draft draft(file);  // has the time of the disk
    static_cast<void>(::fstat(draft.file().get(), &now));
  } catch (const Error&) {
    // Who may not write there goes by the clock.
  }
  return std::chrono::abs(seconds(now.st_mtim.tv_sec - found.st_mtim.tv_sec)) < oldest_sign;
}

}  // namespace previz::farm
