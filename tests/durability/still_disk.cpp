#include "tests/durability/still_disk.hpp"

#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <condition_variable>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <map>
#include <mutex>
#include <string>
#include <type_traits>
#include <vector>

namespace previz::test {
namespace {

struct Disk {
  std::mutex mutex;
  std::condition_variable goes_on;
  bool watches = false;
  std::string folder;               // absolute, without a slash at its end
  std::map<int, std::string> open;  // paths by descriptor, of those below it
  std::vector<std::string> calls;
  std::size_t still_from = SIZE_MAX, waiting = 0;
  std::size_t fails_from = SIZE_MAX, works_from = SIZE_MAX;
};

Disk& disk() {
  static Disk& it = *new Disk;  // outlives whatever closes files at exit
  return it;
}

template <typename Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

bool is_inside(const char* path) {
  const std::string& folder = disk().folder;
  return path && std::strncmp(path, folder.c_str(), folder.size()) == 0 &&
         (path[folder.size()] == '/' || path[folder.size()] == '\0');
}

// Returns whether the call works.
bool pass(std::unique_lock<std::mutex>& lock, const char* function, const std::string& path) {
  Disk& d = disk();
  const std::size_t call = d.calls.size();
  d.calls.push_back(function + (" " + path));
  if (call >= d.still_from) {
    ++d.waiting;
    d.goes_on.wait(lock, [&] { return !d.watches || d.still_from == SIZE_MAX; });
    --d.waiting;
  }
  if (call < d.fails_from || call >= d.works_from) return true;
  errno = EIO;
  return false;
}

// Wait while the disk stands still, if the call is for it; return whether the call works.
bool pass(const char* function, const char* path) {
  std::unique_lock lock(disk().mutex);
  return !disk().watches || !is_inside(path) || pass(lock, function, path);
}
bool pass(const char* function, int descriptor) {
  std::unique_lock lock(disk().mutex);
  if (!disk().watches) return true;
  const auto open = disk().open.find(descriptor);
  return open == disk().open.end() || pass(lock, function, std::string(open->second));
}

// Calls the C library's function of this name, whose first argument is the path or descriptor that
// the call is for. Returns its own error where the call does not work.
template <typename Function, typename Where, typename... Arguments>
auto passed(const char* name, Where where, Arguments... arguments) {
  using Result = decltype(real<Function>(name)(where, arguments...));
  if (pass(name, where)) return real<Function>(name)(where, arguments...);
  if constexpr (std::is_pointer_v<Result>)
    return Result{nullptr};
  else
    return Result{-1};
}

int opened(int descriptor, const char* path) {
  const std::lock_guard lock(disk().mutex);
  disk().open.erase(descriptor);
  if (descriptor >= 0 && disk().watches && is_inside(path)) disk().open[descriptor] = path;
  return descriptor;
}

int open_passed(const char* path, int flags, mode_t mode) {
  if (!pass("open", path)) return -1;
  return opened(real<int(const char*, int, ...)>("open64")(path, flags, mode), path);
}

}  // namespace

StillDisk::StillDisk(const std::filesystem::path& folder) {
  Disk& d = disk();
  const std::lock_guard lock(d.mutex);
  d.folder = std::filesystem::absolute(folder).lexically_normal().string();
  if (d.folder.ends_with('/')) d.folder.pop_back();
  d.open.clear();
  d.calls.clear();
  d.still_from = d.fails_from = d.works_from = SIZE_MAX;
  d.watches = true;
}

StillDisk::~StillDisk() {
  const std::lock_guard lock(disk().mutex);
  disk().watches = false;
  disk().goes_on.notify_all();
}

void StillDisk::stand_still(std::size_t call) {
  const std::lock_guard lock(disk().mutex);
  disk().still_from = call;
}

void StillDisk::stand_still() {
  const std::lock_guard lock(disk().mutex);
  disk().still_from = disk().calls.size();
}

void StillDisk::fail(std::size_t call, ReadFault fault) {
  const std::lock_guard lock(disk().mutex);
  disk().fails_from = call;
  disk().works_from = fault == ReadFault::once ? call + 1 : SIZE_MAX;
}

void StillDisk::go_on() {
  const std::lock_guard lock(disk().mutex);
  disk().still_from = disk().fails_from = SIZE_MAX;
  disk().goes_on.notify_all();
}

std::size_t StillDisk::calls() const {
  const std::lock_guard lock(disk().mutex);
  return disk().calls.size();
}

std::string StillDisk::describe(std::size_t call) const {
  const std::lock_guard lock(disk().mutex);
  return call < disk().calls.size() ? disk().calls[call] : "after the last call";
}

std::size_t StillDisk::waiting() const {
  const std::lock_guard lock(disk().mutex);
  return disk().waiting;
}

}  // namespace previz::test

// These stand before the C library's functions of the same name.
extern "C" {

using previz::test::pass;
using previz::test::passed;
using previz::test::real;

int open(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const auto mode = static_cast<mode_t>(va_arg(rest, int));
  va_end(rest);
  return previz::test::open_passed(path, flags, mode);
}
[[gnu::alias("open")]] int open64(const char* path, int flags, ...);
FILE* fopen(const char* path, const char* mode) {
  if (!pass(__func__, path)) return nullptr;
  return real<FILE*(const char*, const char*)>("fopen64")(path, mode);
}
[[gnu::alias("fopen")]] FILE* fopen64(const char* path, const char* mode);
int close(int descriptor) {
  {
    const std::lock_guard lock(previz::test::disk().mutex);
    previz::test::disk().open.erase(descriptor);
  }
  return real<int(int)>("close")(descriptor);
}

ssize_t read(int descriptor, void* bytes, size_t count) {
  return passed<ssize_t(int, void*, size_t)>(__func__, descriptor, bytes, count);
}
ssize_t pread64(int descriptor, void* bytes, size_t count, off64_t offset) {
  return passed<ssize_t(int, void*, size_t, off64_t)>(__func__, descriptor, bytes, count, offset);
}
[[gnu::alias("pread64")]] ssize_t pread(int descriptor, void* bytes, size_t count, off_t offset);
ssize_t write(int descriptor, const void* bytes, size_t count) {
  return passed<ssize_t(int, const void*, size_t)>(__func__, descriptor, bytes, count);
}
int fsync(int descriptor) {
  return passed<int(int)>(__func__, descriptor);
}
int fdatasync(int descriptor) {
  return passed<int(int)>(__func__, descriptor);
}
int flock(int descriptor, int operation) noexcept {
  return passed<int(int, int)>(__func__, descriptor, operation);
}
int fstat(int descriptor, struct stat* status) noexcept {
  return passed<int(int, struct stat*)>(__func__, descriptor, status);
}

int stat(const char* path, struct stat* status) noexcept {
  return passed<int(const char*, struct stat*)>(__func__, path, status);
}
int stat64(const char* path, struct stat64* status) noexcept {
  return passed<int(const char*, struct stat64*)>(__func__, path, status);
}
int lstat(const char* path, struct stat* status) noexcept {
  return passed<int(const char*, struct stat*)>(__func__, path, status);
}
int lstat64(const char* path, struct stat64* status) noexcept {
  return passed<int(const char*, struct stat64*)>(__func__, path, status);
}
int access(const char* path, int mode) noexcept {
  return passed<int(const char*, int)>(__func__, path, mode);
}
int statvfs(const char* path, struct statvfs* status) noexcept {
  return passed<int(const char*, struct statvfs*)>(__func__, path, status);
}
int statvfs64(const char* path, struct statvfs64* status) noexcept {
  return passed<int(const char*, struct statvfs64*)>(__func__, path, status);
}
DIR* opendir(const char* path) {
  return passed<DIR*(const char*)>(__func__, path);
}
char* realpath(const char* path, char* resolved) noexcept {
  return passed<char*(const char*, char*)>(__func__, path, resolved);
}

int rename(const char* from, const char* to) noexcept {
  if (!pass(__func__, to)) return -1;
  return real<int(const char*, const char*)>("rename")(from, to);
}
int link(const char* from, const char* to) noexcept {
  if (!pass(__func__, to)) return -1;
  return real<int(const char*, const char*)>("link")(from, to);
}
int mkdir(const char* path, mode_t mode) noexcept {
  return passed<int(const char*, mode_t)>(__func__, path, mode);
}
int unlink(const char* path) noexcept {
  return passed<int(const char*)>(__func__, path);
}
int remove(const char* path) noexcept {
  return passed<int(const char*)>(__func__, path);
}

}  // extern "C"
