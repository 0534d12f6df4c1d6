// The Vulkan device: one compute queue, buffers and texel views. Internal to the render room: it
// includes Vulkan-Hpp, so nothing outside daemon/render/ may include it.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>
#include <vulkan/vulkan_raii.hpp>

#include "daemon/render/gpu.hpp"

namespace previz::render {

class Device {
 public:
  // Throws previz::Error saying what is missing and which devices were found.
  explicit Device(DeviceOptions options);
  // All of it anew; throws as the constructor does, and can be called again.
  void reopen();
  bool is_open() const { return static_cast<bool>(*device_); }  // not after a reopen() that threw

  const vk::raii::Device& vk() const { return device_; }
  const std::string& name() const { return name_; }
  const vk::PhysicalDeviceLimits& limits() const { return limits_; }
  bool is_cpu() const { return is_cpu_; }
  // Bytes that all buffers may take: the device's own memory, or the computer's for a CPU device.
  std::uint64_t memory_bytes() const;
  std::uint64_t validation_messages() const { return validation_messages_; }
  // Whether debug labels can be recorded, which GPU debuggers show.
  bool has_labels() const { return has_labels_; }

  // Index of a memory type of `allowed_bits` with all of `wanted`, preferring `preferred` too.
  std::uint32_t memory_type(std::uint32_t allowed_bits, vk::MemoryPropertyFlags wanted,
                            vk::MemoryPropertyFlags preferred) const;

  // Records, submits and waits. Throws DeviceLost naming the device if it is lost. What `record`
  // throws is passed on, and nothing of it is submitted.
  void submit(const std::function<void(const vk::raii::CommandBuffer&)>& record);
  // The number of submissions so far, with the one that is being recorded.
  std::uint64_t submissions() const { return submissions_; }

 private:
  void open();
  void close();
  void create_instance(bool validation);
  void pick_physical_device(const std::string& wanted_name);
  void create_device();

  const DeviceOptions options_;
  vk::raii::Context context_;
  std::atomic<std::uint64_t> validation_messages_ = 0;
  bool has_labels_ = false;
  std::uint64_t submissions_ = 0;
  vk::raii::Instance instance_{nullptr};
  vk::raii::DebugUtilsMessengerEXT messenger_{nullptr};
  vk::raii::PhysicalDevice physical_{nullptr};
  std::uint32_t queue_family_ = 0;
  std::string name_;
  vk::PhysicalDeviceLimits limits_;
  bool is_cpu_ = false;
  vk::raii::Device device_{nullptr};
  vk::raii::Queue queue_{nullptr};
  vk::raii::CommandPool pool_{nullptr};
  vk::raii::CommandBuffer commands_{nullptr};
  vk::raii::Fence fence_{nullptr};
};

// Device memory with a size in bytes; at least 16 bytes are allocated, so that an empty array can
// still be bound. Written and read through upload() and download().
struct Buffer {
  vk::raii::Buffer buffer{nullptr};
  vk::raii::DeviceMemory memory{nullptr};
  vk::raii::BufferView view{nullptr};  // texel buffers only
  vk::DeviceSize size = 0;
  void* mapped = nullptr;  // non-null where the memory is host-visible
};

Buffer create_storage_buffer(Device& device, vk::DeviceSize size);
Buffer create_indirect_buffer(Device& device, vk::DeviceSize size);
// Read as texels, written by uploads or as a storage buffer.
Buffer create_texel_buffer(Device& device, vk::DeviceSize size, vk::Format format);

// `offset` in bytes. Throws previz::Error where it would not fit.
void upload_bytes(Device& device, Buffer& buffer, std::span<const std::byte> bytes,
                  vk::DeviceSize offset = 0);
void download_bytes(Device& device, const Buffer& buffer, std::span<std::byte> bytes);
// The first `size` bytes, where they are if the host can read them, else a copy that is gone after.
void read_bytes(Device& device, const Buffer& buffer, vk::DeviceSize size,
                const std::function<void(const std::byte*)>& visit);

// (Re)creates `buffer` where it is too small, then uploads. Returns true if it was recreated, so
// that descriptors must be written again.
template <typename T>
bool upload_storage(Device& device, Buffer& buffer, const std::vector<T>& data) {
  const vk::DeviceSize size = data.size() * sizeof(T);
  const bool grow = !*buffer.buffer || buffer.size < size;
  if (grow) buffer = create_storage_buffer(device, size);
  upload_bytes(device, buffer, std::as_bytes(std::span(data)));
  return grow;
}
template <typename T>
bool upload_texels(Device& device, Buffer& buffer, const std::vector<T>& data, vk::Format format) {
  const vk::DeviceSize size = data.size() * sizeof(T);
  const bool grow = !*buffer.buffer || buffer.size < size;
  if (grow) buffer = create_texel_buffer(device, size, format);
  upload_bytes(device, buffer, std::as_bytes(std::span(data)));
  return grow;
}
template <typename T>
void read(Device& device, const Buffer& buffer, std::size_t count, const auto& visit) {
  read_bytes(device, buffer, count * sizeof(T), [&](const std::byte* bytes) {
    visit(std::span(reinterpret_cast<const T*>(bytes), count));
  });
}
template <typename T>
std::vector<T> download(Device& device, const Buffer& buffer, std::size_t count) {
  std::vector<T> data(count);
  download_bytes(device, buffer, std::as_writable_bytes(std::span(data)));
  return data;
}

// Records that the buffers are filled with zeros, and a barrier() after it.
void record_clear(const vk::raii::CommandBuffer& commands,
                  std::initializer_list<const Buffer*> buffers);

// Makes what earlier dispatches and transfers wrote visible to later dispatches (and their indirect
// arguments) and transfers.
void barrier(const vk::raii::CommandBuffer& commands);

}  // namespace previz::render
