// A picture in a graphics card's memory. A display that is driven by the same card shows it without
// its coming down to the computer.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "drivers/descriptor.hpp"

namespace previz {

// Names a card and its driver, as Vulkan and OpenGL ES both do: only with both of them equal does
// one know how the other's memory is laid out (VK_KHR_external_memory_fd, GL_EXT_memory_object_fd).
struct CardIdentity {
  std::array<std::uint8_t, 16> device{}, driver{};  // UUIDs

  friend bool operator==(const CardIdentity&, const CardIdentity&) = default;
};

// Memory that holds one picture: an image of 8 bits a channel, RGBA, as Vulkan's optimal tiling
// lays it out, in an allocation of its own.
struct CardMemory {
  CardIdentity card;
  std::uint64_t id = 0;        // no other memory of the process has it
  std::uint64_t bytes = 0;     // of the allocation
  int width = 0, height = 0;   // pixels
  OwnedDescriptor descriptor;  // opaque; whoever imports it needs a copy of the descriptor
};

// While anybody holds the picture, its memory has no other one. It may be held beyond the end of
// the device that made it.
struct CardPicture {
  std::shared_ptr<const CardMemory> memory;
  std::uint64_t number = 0;  // no other picture of the process has it
};
using CardPicturePtr = std::shared_ptr<const CardPicture>;

}  // namespace previz
