#include "daemon/core/render/picture/scratch.hpp"

#include <fcntl.h>
#include <linux/fs.h>
#include <linux/magic.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cinttypes>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <string>
#include <utility>

#include "drivers/descriptor.hpp"
#include "drivers/error.hpp"

namespace previz::render {
namespace {

// How long more than allowed may stay in memory: a core touches new pages of some 100 MB meanwhile.
constexpr std::chrono::milliseconds watch_interval{20};

std::size_t page_bytes() {
  static const auto bytes = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  return bytes;
}

std::size_t whole_pages(std::size_t bytes) {
  return (std::max<std::size_t>(bytes, 1) + page_bytes() - 1) / page_bytes() * page_bytes();
}

// Returns the bytes of files that are mapped and in memory, of programs and libraries too.
std::uint64_t resident_file_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    std::uint64_t kib = 0;
    if (std::sscanf(line.c_str(), "RssFile: %" SCNu64 " kB", &kib) == 1) return 1024 * kib;
  }
  return 0;
}

[[noreturn]] void fail(const std::filesystem::path& folder, const std::string& why) {
  throw Error(folder.string() + ": cannot hold the scratch files of a render: " + why +
              "; name a folder on a local disk with --scratch");
}

// Btrfs writes elsewhere what is written again, and would need room beyond what was reserved.
void write_in_place(int file) {
  int flags = 0;
  if (::ioctl(file, FS_IOC_GETFLAGS, &flags) != 0) return;
  flags |= FS_NOCOW_FL;
  ::ioctl(file, FS_IOC_SETFLAGS, &flags);
}

// Returns a file that has no name, so that nobody has to remove it.
OwnedDescriptor nameless_file(const std::filesystem::path& folder) {
  OwnedDescriptor file(::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600));
  if (file) write_in_place(file.get());
  if (file || (errno != EOPNOTSUPP && errno != EISDIR && errno != ENOENT)) return file;
  std::string name = folder / "previz-scratch-XXXXXX";  // not every file system has O_TMPFILE
  file = OwnedDescriptor(::mkostemp(name.data(), O_CLOEXEC));
  if (file) ::unlink(name.c_str());
  return file;
}

}  // namespace

Scratch::Scratch(std::filesystem::path folder, std::uint64_t resident)
    : folder_(std::move(folder)),
      most_resident_(resident),
      resident_before_(resident_file_bytes()) {
  struct statfs system {};
  if (::statfs(folder_.c_str(), &system) != 0) fail(folder_, std::strerror(errno));
  if (system.f_type == TMPFS_MAGIC || system.f_type == RAMFS_MAGIC)
    fail(folder_, "it lies in the computer's memory");
  if (system.f_type == NFS_SUPER_MAGIC) fail(folder_, "it lies on another computer");
  if (!nameless_file(folder_)) fail(folder_, std::strerror(errno));
  watcher_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
}

Scratch::~Scratch() = default;

std::uint64_t Scratch::room(const std::filesystem::path& folder) {
  std::error_code unknown;
  const std::filesystem::space_info space = std::filesystem::space(folder, unknown);
  return unknown ? 0 : space.available;
}

std::size_t Scratch::alignment() {
  return page_bytes();
}

void* Scratch::take(std::size_t bytes) {
  bytes = whole_pages(bytes);
  const OwnedDescriptor file = nameless_file(folder_);
  if (!file) fail(folder_, std::strerror(errno));
  // Without room that is reserved, a write to mapped memory would end the process.
  if (::fallocate(file.get(), 0, 0, static_cast<off_t>(bytes)) != 0)
    fail(folder_, "it has no room for " + std::to_string(bytes / 1'000'000) + " MB more (" +
                      std::strerror(errno) + ")");
  const std::lock_guard lock(mutex_);
  blocks_.reserve(blocks_.size() + 1);
  void* const memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, file.get(), 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  blocks_.push_back({memory, bytes});
  return memory;
}

void Scratch::give_back(void* memory, std::size_t bytes) {
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(blocks_, [&](const Block& known) { return known.memory == memory; });
  }
  ::munmap(memory, whole_pages(bytes));
}

// Pages of a mapped file that are given up stay in the kernel's cache as long as there is room, and
// come back from there or from the disk. So this may happen at any time.
void Scratch::watch(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    std::this_thread::sleep_for(watch_interval);
    if (resident_file_bytes() <= resident_before_ + most_resident_) continue;
    const std::lock_guard lock(mutex_);
    for (const Block& known : blocks_) ::madvise(known.memory, known.bytes, MADV_DONTNEED);
  }
}

}  // namespace previz::render
