// Memory that runs out: while it lives, some allocations of this process fail, as on a computer
// whose memory is full. The thread that makes it has enough, but for what it does in lacking().
//
// It stands before the C library's functions in the program it is linked into.
#pragma once

#include <cstddef>

namespace previz::test {

class ScarceMemory {
 public:
  // So many allocations fail from this one on, counted from 0 over all threads. One at a time.
  ScarceMemory(std::size_t from, std::size_t count);
  ~ScarceMemory();
  ScarceMemory(const ScarceMemory&) = delete;
  ScarceMemory& operator=(const ScarceMemory&) = delete;

  // Does something that may lack memory as well.
  template <typename Work>
  void lacking(const Work& work) {
    Lack lack;
    work();
  }
  std::size_t allocations() const;  // so far

 private:
  struct Lack {
    Lack();
    ~Lack();
  };
};

}  // namespace previz::test
