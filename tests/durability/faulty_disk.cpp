#include "tests/durability/faulty_disk.hpp"

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <fstream>
#include <map>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string_view>

namespace previz::test {
namespace {

using Path = std::filesystem::path;

constexpr std::size_t page = 4096;

// A file or folder of the watched one. Names are entries of folders.
struct Node {
  bool is_folder = false;
  std::string content;
  std::map<std::string, std::size_t> entries;
};
// The nodes as the kernel has them and as the medium has them, by the same indices. The root is 0.
struct State {
  std::vector<Node> now{{true, {}, {}}}, kept{{true, {}, {}}};
};

struct Call {
  enum class Kind { make, write, resize, sync, forget, rename, link, remove, refused };
  Kind kind;
  std::size_t node = 0;    // that is made, written, resized, synced
  std::size_t folder = 0;  // that holds the name
  std::string name = {};
  std::size_t new_folder = 0;  // rename
  std::string new_name = {};
  bool is_folder = false;  // make
  std::size_t offset = 0;  // write; resize: the new size
  std::string bytes = {};  // write
};

void apply(State& state, const Call& call) {
  switch (call.kind) {
    case Call::Kind::make:
      state.now.push_back({call.is_folder, {}, {}});
      state.kept.push_back({call.is_folder, {}, {}});
      state.now[call.folder].entries[call.name] = call.node;
      return;
    case Call::Kind::write: {
      std::string& content = state.now[call.node].content;
      content.resize(std::max(content.size(), call.offset + call.bytes.size()));
      content.replace(call.offset, call.bytes.size(), call.bytes);
      return;
    }
    case Call::Kind::resize:
      state.now[call.node].content.resize(call.offset);
      return;
    case Call::Kind::sync:
      state.kept[call.node] = state.now[call.node];
      return;
    case Call::Kind::forget: {
      // The kernel takes the pages for written from now on, and the medium does not have them.
      const std::size_t size = state.now[call.node].content.size();
      state.now[call.node].content = state.kept[call.node].content;
      state.now[call.node].content.resize(size);
      return;
    }
    case Call::Kind::rename: {
      auto& from = state.now[call.folder].entries;
      const std::size_t node = from.at(call.name);
      from.erase(call.name);
      state.now[call.new_folder].entries[call.new_name] = node;
      return;
    }
    case Call::Kind::link:
      state.now[call.folder].entries[call.name] = call.node;
      return;
    case Call::Kind::remove:
      state.now[call.folder].entries.erase(call.name);
      return;
    case Call::Kind::refused:
      return;
  }
}

struct Fault {
  std::size_t call;
  DiskFault fault;
};

struct Disk {
  std::mutex mutex;
  bool watches = false;
  Path folder;
  State state;
  std::vector<Call> calls;
  std::map<int, std::size_t> open;  // nodes by descriptor
  std::optional<Fault> fault;
  std::optional<std::string> unwritable;  // the file whose next write fails
};

Disk& disk() {
  static Disk& it = *new Disk;  // outlives whatever closes files at exit
  return it;
}

// ---- finding nodes; call these with the lock held

struct Place {
  std::size_t folder;
  std::string name = {};
  std::optional<std::size_t> node;  // nothing: the name is free
};

// Returns where a path is below the watched folder; nothing if it is not.
std::optional<Place> place_of(const char* path) {
  const Disk& d = disk();
  if (!d.watches || path == nullptr) return std::nullopt;
  const Path whole = Path(path).is_absolute() ? Path(path) : std::filesystem::current_path() / path;
  const Path normal = whole.lexically_normal();
  const auto [rest, inside] =
      std::mismatch(d.folder.begin(), d.folder.end(), normal.begin(), normal.end());
  if (rest != d.folder.end()) return std::nullopt;
  std::vector<std::string> names;
  for (auto at = inside; at != normal.end(); ++at)
    if (!at->empty()) names.push_back(at->string());
  if (names.empty()) return Place{0, "", 0};
  std::size_t node = 0;
  for (std::size_t i = 0; i + 1 < names.size(); ++i) {
    const auto found = d.state.now[node].entries.find(names[i]);
    if (found == d.state.now[node].entries.end()) return std::nullopt;
    node = found->second;
  }
  const auto& entries = d.state.now[node].entries;
  const auto found = entries.find(names.back());
  return Place{node, names.back(),
               found == entries.end() ? std::nullopt : std::optional(found->second)};
}

std::optional<std::size_t> node_of(int descriptor) {
  const Disk& d = disk();
  if (!d.watches) return std::nullopt;
  const auto found = d.open.find(descriptor);
  return found == d.open.end() ? std::nullopt : std::optional(found->second);
}

// Returns the fault that is meant for the next call.
std::optional<DiskFault> next_fault() {
  const Disk& d = disk();
  if (!d.fault || d.fault->call != d.calls.size()) return std::nullopt;
  return d.fault->fault;
}

// Returns whether the next call fails, which is then counted as one that changes nothing.
bool is_refused() {
  const std::optional<DiskFault> fault = next_fault();
  if (!fault || *fault == DiskFault::short_write) return false;
  disk().calls.push_back({.kind = Call::Kind::refused});
  errno = *fault == DiskFault::io_error ? EIO : ENOSPC;
  return true;
}

void note(Call call) {
  Disk& d = disk();
  apply(d.state, call);
  d.calls.push_back(std::move(call));
}

// ---- the C library's own functions

template <typename Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

int open_noted(const char* path, int flags, mode_t mode) {
  const auto call = real<int(const char*, int, ...)>("open64");
  const std::lock_guard lock(disk().mutex);
  const std::optional<Place> place = place_of(path);
  if (!place) {
    const int other = call(path, flags, mode);
    disk().open.erase(other);  // fclose(3) closes descriptors unseen, whose numbers come again
    return other;
  }
  const bool makes = (flags & O_CREAT) != 0 && !place->node;
  const bool empties = (flags & O_TRUNC) != 0 && place->node;
  if ((makes || empties) && is_refused()) return -1;
  const int descriptor = call(path, flags, mode);
  if (descriptor < 0) return descriptor;
  std::size_t node = place->node.value_or(0);
  if (makes) {
    node = disk().state.now.size();
    note({.kind = Call::Kind::make, .node = node, .folder = place->folder, .name = place->name});
  } else if (empties) {
    note({.kind = Call::Kind::resize, .node = node, .name = place->name});
  }
  disk().open[descriptor] = node;
  return descriptor;
}

std::string name_of(std::size_t node) {
  for (const Node& folder : disk().state.now)
    for (const auto& [name, entry] : folder.entries)
      if (entry == node) return name;
  return node == 0 ? "." : "?";
}

// `offset` below 0: where the descriptor stands.
ssize_t write_noted(int descriptor, const void* bytes, std::size_t count, off_t offset) {
  const auto call = real<ssize_t(int, const void*, std::size_t)>("write");
  const auto call_at = real<ssize_t(int, const void*, std::size_t, off_t)>("pwrite64");
  const auto forward = [&](std::size_t n) {
    return offset < 0 ? call(descriptor, bytes, n) : call_at(descriptor, bytes, n, offset);
  };
  const std::unique_lock lock(disk().mutex);
  const std::optional<std::size_t> node = node_of(descriptor);
  if (!node) return forward(count);
  if (disk().unwritable == name_of(*node)) {
    disk().fault = {disk().calls.size(), DiskFault::io_error};
    disk().unwritable.reset();
  }
  if (is_refused()) return -1;
  if (next_fault() == DiskFault::short_write && count > 1) count /= 2;
  off_t at = offset;
  if (offset < 0)
    at = (::fcntl(descriptor, F_GETFL) & O_APPEND) != 0
             ? static_cast<off_t>(disk().state.now[*node].content.size())
             : ::lseek(descriptor, 0, SEEK_CUR);
  const ssize_t written = forward(count);
  if (written > 0)
    note(
        {.kind = Call::Kind::write,
         .node = *node,
         .name = name_of(*node),
         .offset = static_cast<std::size_t>(at),
         .bytes = std::string(static_cast<const char*>(bytes), static_cast<std::size_t>(written))});
  return written;
}

int sync_noted(const char* name, int descriptor) {
  const auto call = real<int(int)>(name);
  const std::lock_guard lock(disk().mutex);
  const std::optional<std::size_t> node = node_of(descriptor);
  if (!node) return call(descriptor);
  if (next_fault() == DiskFault::io_error) {
    note({.kind = Call::Kind::forget, .node = *node, .name = name_of(*node)});
    errno = EIO;
    return -1;
  }
  if (is_refused()) return -1;
  note({.kind = Call::Kind::sync, .node = *node, .name = name_of(*node)});
  return 0;  // the medium behind the folder may forget, too: nobody asks it
}

// Runs a call that changes a name, and notes it where it succeeds.
template <typename Forward>
int change_noted(const char* path, const Forward& forward, const auto& call_of) {
  const std::lock_guard lock(disk().mutex);
  const std::optional<Place> place = place_of(path);
  if (!place) return forward();
  if (is_refused()) return -1;
  const int result = forward();
  if (result == 0) note(call_of(*place));
  return result;
}

int remove_noted(const char* name, const char* path) {
  const auto forward = [&] { return real<int(const char*)>(name)(path); };
  return change_noted(path, forward, [](const Place& place) {
    return Call{.kind = Call::Kind::remove, .folder = place.folder, .name = place.name};
  });
}

}  // namespace

FaultyDisk::FaultyDisk(const Path& folder) {
  Disk& d = disk();
  const std::lock_guard lock(d.mutex);
  if (d.watches) throw std::logic_error("there is a FaultyDisk already");
  d.folder = std::filesystem::absolute(folder).lexically_normal();
  if (!d.folder.has_filename()) d.folder = d.folder.parent_path();
  d.state = {};
  d.calls.clear();
  d.open.clear();
  d.fault.reset();
  d.unwritable.reset();
  d.watches = true;
}

FaultyDisk::~FaultyDisk() {
  const std::lock_guard lock(disk().mutex);
  disk().watches = false;
}

void FaultyDisk::fail(std::size_t call, DiskFault fault) {
  const std::lock_guard lock(disk().mutex);
  disk().fault = {call, fault};
}

void FaultyDisk::fail_next_write_of(const std::string& name) {
  const std::lock_guard lock(disk().mutex);
  disk().unwritable = name;
}

std::size_t FaultyDisk::calls() const {
  const std::lock_guard lock(disk().mutex);
  return disk().calls.size();
}

std::string FaultyDisk::describe(std::size_t call) const {
  constexpr const char* kinds[] = {"make",   "write", "resize", "sync",   "sync in vain",
                                   "rename", "link",  "remove", "refused"};
  const std::lock_guard lock(disk().mutex);
  if (call >= disk().calls.size()) return "after the last call";
  const Call& c = disk().calls[call];
  return std::string(kinds[static_cast<int>(c.kind)]) + " " + c.name;
}

void FaultyDisk::restore(std::size_t call, AfterPowerCut kept, const Path& target) const {
  State state;
  {
    const std::lock_guard lock(disk().mutex);
    for (std::size_t i = 0; i < std::min(call, disk().calls.size()); ++i)
      apply(state, disk().calls[i]);
  }
  std::filesystem::remove_all(target);
  const auto write = [&](auto&& self, std::size_t node, const Path& path) -> void {
    const bool has_names = kept != AfterPowerCut::what_was_synced;
    if (state.now[node].is_folder) {
      std::filesystem::create_directories(path);
      for (const auto& [name, entry] : (has_names ? state.now : state.kept)[node].entries)
        self(self, entry, path / name);
      return;
    }
    std::string content =
        (kept == AfterPowerCut::everything ? state.now : state.kept)[node].content;
    const std::string& now = state.now[node].content;
    const bool has_head = kept == AfterPowerCut::names_and_heads;
    if (kept == AfterPowerCut::names_and_sizes || has_head) content.resize(now.size());
    if (has_head) std::copy_n(now.begin(), std::min(now.size(), page), content.begin());
    std::ofstream(path, std::ios::binary) << content;
  };
  write(write, 0, target);
}

}  // namespace previz::test

// These stand before the C library's functions of the same name.
extern "C" {

using previz::test::Call;
using previz::test::change_noted;
using previz::test::disk;
using previz::test::note;
using previz::test::Place;
using previz::test::real;
using previz::test::remove_noted;

int open(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const auto mode = static_cast<mode_t>(va_arg(rest, int));
  va_end(rest);
  return previz::test::open_noted(path, flags, mode);
}
[[gnu::alias("open")]] int open64(const char* path, int flags, ...);

// A stream's descriptor is opened here, so that it is known to the calls below.
FILE* fopen(const char* path, const char* mode) {
  const std::string_view wanted = mode;
  const bool both = wanted.find('+') != std::string_view::npos;
  int flags = both ? O_RDWR : wanted[0] == 'r' ? O_RDONLY : O_WRONLY;
  if (wanted[0] == 'w') flags |= O_CREAT | O_TRUNC;
  if (wanted[0] == 'a') flags |= O_CREAT | O_APPEND;
  if (wanted.find('e') != std::string_view::npos) flags |= O_CLOEXEC;
  if (wanted.find('x') != std::string_view::npos) flags |= O_EXCL;
  const int descriptor = previz::test::open_noted(path, flags, 0666);
  return descriptor < 0 ? nullptr : ::fdopen(descriptor, mode);
}
[[gnu::alias("fopen")]] FILE* fopen64(const char* path, const char* mode);

int close(int descriptor) {
  {
    const std::lock_guard lock(disk().mutex);
    disk().open.erase(descriptor);
  }
  return real<int(int)>("close")(descriptor);
}

ssize_t write(int descriptor, const void* bytes, size_t count) {
  return previz::test::write_noted(descriptor, bytes, count, -1);
}
ssize_t pwrite(int descriptor, const void* bytes, size_t count, off_t offset) {
  return previz::test::write_noted(descriptor, bytes, count, offset);
}
[[gnu::alias("pwrite")]] ssize_t pwrite64(int descriptor, const void* bytes, size_t count,
                                          off64_t offset);
ssize_t writev(int descriptor, const iovec* parts, int count) {
  {
    const std::lock_guard lock(disk().mutex);
    if (!previz::test::node_of(descriptor))
      return real<ssize_t(int, const iovec*, int)>("writev")(descriptor, parts, count);
  }
  std::string bytes;
  for (int i = 0; i < count; ++i)
    bytes.append(static_cast<const char*>(parts[i].iov_base), parts[i].iov_len);
  return previz::test::write_noted(descriptor, bytes.data(), bytes.size(), -1);
}

// Copies inside the kernel cannot be seen; whoever asks has to copy by himself.
ssize_t sendfile(int, int, off_t*, size_t) {
  errno = EINVAL;
  return -1;
}
[[gnu::alias("sendfile")]] ssize_t sendfile64(int, int, off64_t*, size_t);
ssize_t copy_file_range(int, off64_t*, int, off64_t*, size_t, unsigned) {
  errno = EINVAL;
  return -1;
}

int fsync(int descriptor) {
  return previz::test::sync_noted("fsync", descriptor);
}
int fdatasync(int descriptor) {
  return previz::test::sync_noted("fdatasync", descriptor);
}

int rename(const char* from, const char* to) noexcept {
  const auto forward = [&] { return real<int(const char*, const char*)>("rename")(from, to); };
  return change_noted(to, forward, [&](const Place& target) {
    const Place source = previz::test::place_of(from).value();
    return Call{.kind = Call::Kind::rename,
                .folder = source.folder,
                .name = source.name,
                .new_folder = target.folder,
                .new_name = target.name};
  });
}

int link(const char* from, const char* to) noexcept {
  const auto forward = [&] { return real<int(const char*, const char*)>("link")(from, to); };
  return change_noted(to, forward, [&](const Place& target) {
    return Call{.kind = Call::Kind::link,
                .node = previz::test::place_of(from).value().node.value(),
                .folder = target.folder,
                .name = target.name};
  });
}

int mkdir(const char* path, mode_t mode) noexcept {
  const auto forward = [&] { return real<int(const char*, mode_t)>("mkdir")(path, mode); };
  return change_noted(path, forward, [](const Place& place) {
    return Call{.kind = Call::Kind::make,
                .node = disk().state.now.size(),
                .folder = place.folder,
                .name = place.name,
                .is_folder = true};
  });
}

int unlink(const char* path) noexcept {
  return remove_noted("unlink", path);
}
int remove(const char* path) noexcept {
  return remove_noted("remove", path);
}

int ftruncate(int descriptor, off_t size) noexcept {
  const auto call = real<int(int, off_t)>("ftruncate");
  const std::lock_guard lock(disk().mutex);
  const auto node = previz::test::node_of(descriptor);
  const int result = call(descriptor, size);
  if (node && result == 0)
    note({.kind = Call::Kind::resize, .node = *node, .offset = static_cast<std::size_t>(size)});
  return result;
}

}  // extern "C"
