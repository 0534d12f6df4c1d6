// The memory through which frames pass from the process that receives them to the driver.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/aravis/protocol.hpp"
#include "drivers/descriptor.hpp"

namespace previz::aravis {

// Buffers of the same size in one memory file, whose size is sealed, so that neither side can take
// pages away from under the other. Both sides map it: the receiver fills buffers, the driver reads.
class SharedBuffers {
 public:
  // Makes the memory, which is mapped for reading. Throws previz::Error.
  explicit SharedBuffers(const Ring& ring);
  // Maps memory that the other side made, for reading and writing. Throws previz::Error.
  SharedBuffers(const Ring& ring, OwnedDescriptor memory);
  ~SharedBuffers();
  SharedBuffers(const SharedBuffers&) = delete;
  SharedBuffers& operator=(const SharedBuffers&) = delete;

  int descriptor() const { return memory_.get(); }
  const Ring& ring() const { return ring_; }
  // Returns a buffer; `index` is less than ring().buffers.
  std::span<std::uint8_t> at(std::size_t index) const {
    return {base_ + index * stride_, static_cast<std::size_t>(ring_.payload)};
  }

 private:
  void map(int protection);
  std::size_t bytes() const { return ring_.buffers * stride_; }

  const Ring ring_;
  const std::size_t stride_;
  OwnedDescriptor memory_;
  std::uint8_t* base_ = nullptr;
};

}  // namespace previz::aravis
