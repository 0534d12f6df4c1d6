#include "tests/durability/still_disk.hpp"

#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <condition_variable>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <mutex>
#include <set>
#include <string>
#include <vector>

namespace previz::test {
namespace {

struct Disk {
  std::mutex mutex;
  std::condition_variable goes_on;
  bool watches = false;
  std::string folder;  // absolute, without a slash at its end
  std::set<int> open;  // descriptors below it
  std::size_t calls = 0, still_from = SIZE_MAX, waiting = 0;
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

void pass(std::unique_lock<std::mutex>& lock) {
  Disk& d = disk();
  if (d.calls++ < d.still_from) return;
  ++d.waiting;
  d.goes_on.wait(lock, [&] { return !d.watches || d.still_from == SIZE_MAX; });
  --d.waiting;
}

// Waits while the disk stands still, if the call is for it; returns whether it is.
bool pass(const char* path) {
  std::unique_lock lock(disk().mutex);
  if (!disk().watches || !is_inside(path)) return false;
  pass(lock);
  return true;
}

void pass(int descriptor) {
  std::unique_lock lock(disk().mutex);
  if (disk().watches && disk().open.contains(descriptor)) pass(lock);
}

int opened(int descriptor, bool is_on_disk) {
  const std::lock_guard lock(disk().mutex);
  if (descriptor >= 0 && is_on_disk) disk().open.insert(descriptor);
  if (descriptor >= 0 && !is_on_disk) disk().open.erase(descriptor);
  return descriptor;
}

int open_passed(const char* path, int flags, mode_t mode) {
  const bool is_on_disk = pass(path);
  const int descriptor = real<int(const char*, int, ...)>("open64")(path, flags, mode);
  return opened(descriptor, is_on_disk);
}

}  // namespace

StillDisk::StillDisk(const std::filesystem::path& folder) {
  Disk& d = disk();
  const std::lock_guard lock(d.mutex);
  d.folder = std::filesystem::absolute(folder).lexically_normal().string();
  if (d.folder.ends_with('/')) d.folder.pop_back();
  d.open.clear();
  d.calls = 0;
  d.still_from = SIZE_MAX;
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
  disk().still_from = disk().calls;
}

void StillDisk::go_on() {
  const std::lock_guard lock(disk().mutex);
  disk().still_from = SIZE_MAX;
  disk().goes_on.notify_all();
}

std::size_t StillDisk::calls() const {
  const std::lock_guard lock(disk().mutex);
  return disk().calls;
}

std::size_t StillDisk::waiting() const {
  const std::lock_guard lock(disk().mutex);
  return disk().waiting;
}

}  // namespace previz::test

// These stand before the C library's functions of the same name.
extern "C" {

using previz::test::pass;
using previz::test::real;

int open(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const auto mode = static_cast<mode_t>(va_arg(rest, int));
  va_end(rest);
  return previz::test::open_passed(path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const auto mode = static_cast<mode_t>(va_arg(rest, int));
  va_end(rest);
  return previz::test::open_passed(path, flags, mode);
}
FILE* fopen(const char* path, const char* mode) {
  pass(path);
  return real<FILE*(const char*, const char*)>("fopen64")(path, mode);
}
FILE* fopen64(const char* path, const char* mode) {
  return fopen(path, mode);
}
int close(int descriptor) {
  {
    const std::lock_guard lock(previz::test::disk().mutex);
    previz::test::disk().open.erase(descriptor);
  }
  return real<int(int)>("close")(descriptor);
}

ssize_t read(int descriptor, void* bytes, size_t count) {
  pass(descriptor);
  return real<ssize_t(int, void*, size_t)>("read")(descriptor, bytes, count);
}
ssize_t write(int descriptor, const void* bytes, size_t count) {
  pass(descriptor);
  return real<ssize_t(int, const void*, size_t)>("write")(descriptor, bytes, count);
}
int fsync(int descriptor) {
  pass(descriptor);
  return real<int(int)>("fsync")(descriptor);
}
int fdatasync(int descriptor) {
  pass(descriptor);
  return real<int(int)>("fdatasync")(descriptor);
}
int flock(int descriptor, int operation) noexcept {
  pass(descriptor);
  return real<int(int, int)>("flock")(descriptor, operation);
}
int fstat(int descriptor, struct stat* status) noexcept {
  pass(descriptor);
  return real<int(int, struct stat*)>("fstat")(descriptor, status);
}

int stat(const char* path, struct stat* status) noexcept {
  pass(path);
  return real<int(const char*, struct stat*)>("stat")(path, status);
}
int stat64(const char* path, struct stat64* status) noexcept {
  pass(path);
  return real<int(const char*, struct stat64*)>("stat64")(path, status);
}
int lstat(const char* path, struct stat* status) noexcept {
  pass(path);
  return real<int(const char*, struct stat*)>("lstat")(path, status);
}
int lstat64(const char* path, struct stat64* status) noexcept {
  pass(path);
  return real<int(const char*, struct stat64*)>("lstat64")(path, status);
}
int access(const char* path, int mode) noexcept {
  pass(path);
  return real<int(const char*, int)>("access")(path, mode);
}
int statvfs(const char* path, struct statvfs* status) noexcept {
  pass(path);
  return real<int(const char*, struct statvfs*)>("statvfs")(path, status);
}
int statvfs64(const char* path, struct statvfs64* status) noexcept {
  pass(path);
  return real<int(const char*, struct statvfs64*)>("statvfs64")(path, status);
}
DIR* opendir(const char* path) {
  pass(path);
  return real<DIR*(const char*)>("opendir")(path);
}
char* realpath(const char* path, char* resolved) noexcept {
  pass(path);
  return real<char*(const char*, char*)>("realpath")(path, resolved);
}

int rename(const char* from, const char* to) noexcept {
  pass(to);
  return real<int(const char*, const char*)>("rename")(from, to);
}
int link(const char* from, const char* to) noexcept {
  pass(to);
  return real<int(const char*, const char*)>("link")(from, to);
}
int mkdir(const char* path, mode_t mode) noexcept {
  pass(path);
  return real<int(const char*, mode_t)>("mkdir")(path, mode);
}
int unlink(const char* path) noexcept {
  pass(path);
  return real<int(const char*)>("unlink")(path);
}
int remove(const char* path) noexcept {
  pass(path);
  return real<int(const char*)>("remove")(path);
}

}  // extern "C"
