#include "daemon/core/render/device/device_memory.hpp"

#include <unistd.h>

#include <algorithm>
#include <span>
#include <utility>

#include "drivers/error.hpp"

namespace previz::render {
namespace {

// Returns a bit for each type of the device's own memory that the host can write without flushing.
// Its heap is no smaller than any other of the device: neither a window into one nor a small part.
std::uint32_t types_to_map(const vk::PhysicalDeviceMemoryProperties& memory) {
  using Property = vk::MemoryPropertyFlagBits;
  constexpr auto wanted = Property::eDeviceLocal | Property::eHostVisible | Property::eHostCoherent;
  vk::DeviceSize most = 0;
  for (const vk::MemoryHeap& heap : std::span(memory.memoryHeaps).first(memory.memoryHeapCount))
    if (heap.flags & vk::MemoryHeapFlagBits::eDeviceLocal) most = std::max(most, heap.size);
  std::uint32_t types = 0;
  for (std::uint32_t i = 0; i < memory.memoryTypeCount; ++i) {
    const vk::MemoryType& type = memory.memoryTypes[i];
    const bool fits = memory.memoryHeaps[type.heapIndex].size == most;
    if (fits && (type.propertyFlags & wanted) == wanted) types |= 1u << i;
  }
  return types;
}

}  // namespace

void DeviceMemory::open(const vk::raii::PhysicalDevice& physical, std::string name, bool is_cpu,
                        bool maps) {
  properties_ = physical.getMemoryProperties();
  name_ = std::move(name);
  is_cpu_ = is_cpu;
  mapped_types_ = maps ? types_to_map(properties_) : 0;
}

void DeviceMemory::close() {
  staging_.reset();
}

std::uint32_t DeviceMemory::type(std::uint32_t allowed_bits, vk::MemoryPropertyFlags wanted,
                                 vk::MemoryPropertyFlags preferred) const {
  for (const auto flags : {wanted | preferred, wanted}) {
    for (std::uint32_t i = 0; i < properties_.memoryTypeCount; ++i) {
      const bool has_flags = (properties_.memoryTypes[i].propertyFlags & flags) == flags;
      if ((allowed_bits & (1u << i)) != 0 && has_flags) return i;
    }
  }
  throw Error("Vulkan: " + name_ + " has no suitable memory type");
}

std::uint64_t DeviceMemory::bytes() const {
  // Lavapipe's heap is 2 GiB whatever the computer has.
  if (is_cpu_)
    return static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) *
           static_cast<std::uint64_t>(sysconf(_SC_PAGE_SIZE));
  std::uint64_t most = 0;
  for (std::uint32_t i = 0; i < properties_.memoryHeapCount; ++i)
    if (properties_.memoryHeaps[i].flags & vk::MemoryHeapFlagBits::eDeviceLocal)
      most = std::max<std::uint64_t>(most, properties_.memoryHeaps[i].size);
  return most;
}

}  // namespace previz::render
