// A disk that stands still, as a network mount whose server is gone, or whose calls fail: every
// call of this process for a file below a folder may, the reading ones too.
//
// It stands before the C library's functions in the program it is linked into.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

namespace previz::test {

enum class ReadFault { once, from_then_on };  // a bad sector; a disk that was pulled out

class StillDisk {
 public:
  // One at a time.
  explicit StillDisk(const std::filesystem::path& folder);
  ~StillDisk();  // goes on
  StillDisk(const StillDisk&) = delete;
  StillDisk& operator=(const StillDisk&) = delete;

  // From this call on, counted from 0, each one waits.
  void stand_still(std::size_t call);
  void stand_still();  // from the next one on
  // This call, counted from 0, fails with EIO, or it and all later ones do.
  void fail(std::size_t call, ReadFault fault);
  void go_on();                                  // and works again
  std::size_t calls() const;                     // so far
  std::string describe(std::size_t call) const;  // "read /tmp/take/observer.mkv", ...
  std::size_t waiting() const;                   // threads
};

}  // namespace previz::test
