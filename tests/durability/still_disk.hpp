// A disk that stands still, as a network mount whose server is gone: while it does, every call of
// this process for a file below a folder waits, the reading ones too.
//
// It stands before the C library's functions in the program it is linked into.
#pragma once

#include <cstddef>
#include <filesystem>

namespace previz::test {

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
  void go_on();
  std::size_t calls() const;    // so far
  std::size_t waiting() const;  // threads
};

}  // namespace previz::test
