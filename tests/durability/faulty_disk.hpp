// A disk that fails and that forgets: while it lives, what this process does to files below a
// folder is written down call by call. A call can be made to fail, and the folder can be had as a
// power cut before any call would have left it.
//
// It sees the C library's calls that libraries make (open, write, fsync, rename, ...), by standing
// before them in the program it is linked into. It does not see into <stdio.h>'s own writes nor
// maps.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace previz::test {

enum class DiskFault {
  io_error,     // EIO; what a failing fsync was asked to keep is lost, and later ones do not notice
  no_space,     // ENOSPC
  short_write,  // half of the bytes are written, which is no error
};

// The states in which a power cut may leave a disk. POSIX allows each of these, and file systems do
// them.
enum class AfterPowerCut {
  what_was_synced,  // a file's bytes by its own fsync, its name by its folder's
  names,            // all names, but of the files' bytes only those that were synced
  names_and_sizes,  // likewise, and zeros where bytes are missing
  names_and_heads,  // likewise, but the first page of each file is there
  everything,
};
inline constexpr AfterPowerCut power_cuts[] = {
    AfterPowerCut::what_was_synced, AfterPowerCut::names, AfterPowerCut::names_and_sizes,
    AfterPowerCut::names_and_heads, AfterPowerCut::everything};

class FaultyDisk {
 public:
  // The folder must exist and be empty. One at a time.
  explicit FaultyDisk(const std::filesystem::path& folder);
  ~FaultyDisk();
  FaultyDisk(const FaultyDisk&) = delete;
  FaultyDisk& operator=(const FaultyDisk&) = delete;

  // Lets one call fail, counted from 0. A short write falls upon calls that write only.
  void fail(std::size_t call, DiskFault fault);
  // Lets the next write of a file of this name fail with EIO, whatever other threads call
  // meanwhile.
  void fail_next_write_of(const std::string& name);
  // Returns how many calls there were: those that make, change, sync, rename or remove something.
  std::size_t calls() const;
  std::string describe(std::size_t call) const;  // "write observer.mkv", ...

  // Makes `target` the folder as a power cut just before this call would leave it.
  void restore(std::size_t call, AfterPowerCut kept, const std::filesystem::path& target) const;
};

}  // namespace previz::test
