// The memory that a device has: its types, how much of it, and what copies go through. Internal to
// the render room.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vulkan/vulkan_raii.hpp>

namespace previz::render {

class Staging;  // daemon/core/render/device/buffer.hpp

class DeviceMemory {
 public:
  // Takes the memory of an open device. `name` is for errors; where the host may write the device's
  // own memory, `maps` says whether it does.
  void open(const vk::raii::PhysicalDevice& physical, std::string name, bool is_cpu, bool maps);
  void close();

  // Returns the index of a memory type of `allowed_bits` with all properties of `wanted`, and with
  // those of `preferred` if there is one. Throws previz::Error if there is none.
  std::uint32_t type(std::uint32_t allowed_bits, vk::MemoryPropertyFlags wanted,
                     vk::MemoryPropertyFlags preferred) const;
  // Returns a bit for each type of the device's own memory that the host can write: of a graphics
  // card that is part of the processor. Reading it may be slow.
  std::uint32_t mapped_types() const { return mapped_types_; }
  // Returns how many bytes all buffers together may take: the device's own memory, or the
  // computer's for a CPU device.
  std::uint64_t bytes() const;
  // The memory through which copies go up and come down; empty until it is needed.
  std::shared_ptr<Staging>& staging() { return staging_; }
  // Counts the buffers for shaders that were made, each of which may cost more time than a picture
  // has.
  void count_buffer() { ++made_buffers_; }
  std::uint64_t made_buffers() const { return made_buffers_; }

 private:
  vk::PhysicalDeviceMemoryProperties properties_;
  std::string name_;
  bool is_cpu_ = false;
  std::uint32_t mapped_types_ = 0;
  std::shared_ptr<Staging> staging_;
  std::atomic<std::uint64_t> made_buffers_ = 0;
};

}  // namespace previz::render
