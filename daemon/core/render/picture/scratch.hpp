// Memory as large as a picture that lies in files and not in the computer's memory. A frame's sums,
// layers and averages together have up to 2 kB a pixel, 17 GB for one of 3840x2160, and most of
// them are only touched a band at a time.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <new>
#include <thread>
#include <vector>

namespace previz::render {

// Files without a name in a folder, mapped into memory: they are gone with the process, however it
// ends. What was used last stays in memory, up to a limit; the kernel writes the rest to the disk
// and reads it again when it is used. May be used by any thread.
class Scratch {
 public:
  // Keeps about `resident` bytes of all blocks in the process's memory. Throws previz::Error
  // where the folder cannot hold such files: it is not there, cannot be written, or lies in memory
  // itself.
  Scratch(std::filesystem::path folder, std::uint64_t resident);
  ~Scratch();
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  // Returns the bytes that files in the folder may still take.
  static std::uint64_t room(const std::filesystem::path& folder);
  // Blocks and their sizes are multiples of so many bytes, a page.
  static std::size_t alignment();

  // Returns zeros. Throws previz::Error, with the folder and the size, where the disk has no room,
  // which is reserved at once.
  void* take(std::size_t bytes);
  void give_back(void* memory, std::size_t bytes);

 private:
  struct Block {
    void* memory;
    std::size_t bytes;
  };
  void watch(const std::stop_token& stop);

  const std::filesystem::path folder_;
  const std::uint64_t most_resident_, resident_before_;
  std::mutex mutex_;
  std::vector<Block> blocks_;
  std::jthread watcher_;  // last: it uses the others
};

// An array with an element for each pixel, in scratch memory if it is given some.
template <class T>
class SheetAllocator {
 public:
  using value_type = T;
  using propagate_on_container_move_assignment = std::true_type;
  using propagate_on_container_swap = std::true_type;
  using is_always_equal = std::false_type;

  SheetAllocator() = default;
  SheetAllocator(std::shared_ptr<Scratch> scratch) : scratch_(std::move(scratch)) {}  // NOLINT
  template <class U>
  SheetAllocator(const SheetAllocator<U>& other) : scratch_(other.scratch()) {}  // NOLINT

  const std::shared_ptr<Scratch>& scratch() const { return scratch_; }
  T* allocate(std::size_t count) {
    return static_cast<T*>(scratch_ ? scratch_->take(count * sizeof(T))
                                    : ::operator new(count * sizeof(T)));
  }
  void deallocate(T* memory, std::size_t count) {
    if (scratch_)
      scratch_->give_back(memory, count * sizeof(T));
    else
      ::operator delete(memory);
  }
  friend bool operator==(const SheetAllocator& a, const SheetAllocator& b) {
    return a.scratch_ == b.scratch_;
  }

 private:
  std::shared_ptr<Scratch> scratch_;
};
template <class T>
using Sheet = std::vector<T, SheetAllocator<T>>;

}  // namespace previz::render
