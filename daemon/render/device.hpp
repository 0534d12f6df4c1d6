// This header wraps the Vulkan device: one compute queue, buffers and texel views. It is internal
// to the render room: it includes Vulkan-Hpp, so nothing outside daemon/render/ may include it.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>
#include <vulkan/vulkan_raii.hpp>

#include "daemon/render/device_limits.hpp"
#include "daemon/render/gpu.hpp"
#include "daemon/render/pass_clock.hpp"

namespace previz::render {

struct Program;  // a compute pass compiled for a device: daemon/render/kernel.hpp

class Device {
 public:
  // Throws previz::Error saying what is missing and which devices were found.
  explicit Device(DeviceOptions options);
  struct Awaited {
    bool gpu;  // and no CPU device in its place
  };
  // Opens nothing; reopen() opens a GPU.
  Device(DeviceOptions options, Awaited awaited)
      : options_(std::move(options)), had_gpu_(awaited.gpu) {}
  // Closes and opens the device again. Throws as the constructor does, and can be called again
  // after that. Where there was a GPU, a CPU device is taken only if `cpu_instead`: drivers list
  // one while a GPU is being reset, and it would never be left.
  void reopen(bool cpu_instead);
  bool is_open() const { return static_cast<bool>(*device_); }  // false after a reopen() that threw

  const vk::raii::Device& vk() const { return device_; }
  const std::string& name() const { return name_; }
  const vk::PhysicalDeviceLimits& limits() const { return limits_; }
  const DeviceLimits& allows() const { return allows_; }
  bool is_cpu() const { return is_cpu_; }
  // Returns whether the host works in the device's own memory; otherwise it uploads and downloads
  // by copies, and the device is wide enough to have many samples in flight.
  bool shares_host_memory() const { return is_cpu_ && !options_.as_gpu; }
  // What is open now; may be called on any thread.
  struct Drawing {
    std::string name;  // empty: nothing is open
    bool is_cpu = false, stands_in = false;
  };
  Drawing drawing() const {
    const std::lock_guard lock(drawing_mutex_);
    return drawing_;
  }
  // Returns how many bytes all buffers together may take: the device's own memory, or the
  // computer's for a CPU device.
  std::uint64_t memory_bytes() const;
  std::uint64_t validation_messages() const { return validation_messages_; }
  // Returns whether debug labels, which GPU debuggers show, can be recorded.
  bool has_labels() const { return has_labels_; }

  // Returns the index of a memory type of `allowed_bits` with all properties of `wanted`, and with
  // those of `preferred` if there is one.
  std::uint32_t memory_type(std::uint32_t allowed_bits, vk::MemoryPropertyFlags wanted,
                            vk::MemoryPropertyFlags preferred) const;

  // Records, submits and waits. Throws DeviceLost naming the device if it is lost. If `record`
  // throws, the exception is passed on and nothing is submitted.
  void submit(const std::function<void(const vk::raii::CommandBuffer&)>& record);
  // The number of submissions so far, including the one that is being recorded.
  std::uint64_t submissions() const { return submissions_; }
  PassClock& clock() { return clock_; }

  // The buffers for shaders, and the programs, that were made so far, each of which may cost more
  // time than a picture has.
  struct Made {
    std::uint64_t buffers = 0, programs = 0;
    friend bool operator==(const Made&, const Made&) = default;
  };
  Made made() const { return {made_buffers_, made_programs_}; }
  void count_buffer() { ++made_buffers_; }

  // Returns what `compile` made for the same SPIR-V and constants before, or calls it: compiling
  // may take longer than a picture, and a renderer that is made anew mostly wants what the last one
  // had. The 256 programs that were wanted last are kept; a reopened device has none. `spirv` is
  // known by its address and must stay there.
  std::shared_ptr<const Program> program(
      const std::uint32_t* spirv, std::span<const std::uint32_t> constants,
      const std::function<std::shared_ptr<const Program>()>& compile);
  static constexpr std::size_t most_programs = 256;

 private:
  struct Compiled {
    const std::uint32_t* spirv;
    std::vector<std::uint32_t> constants;
    std::shared_ptr<const Program> program;
  };

  void open(bool cpu_too);
  void close();
  void publish(Drawing drawing);
  void create_instance();
  void pick_physical_device(const std::string& wanted_name, bool cpu_too);
  void create_device();

  const DeviceOptions options_;
  vk::raii::Context context_;
  std::atomic<std::uint64_t> validation_messages_ = 0;
  bool has_labels_ = false;
  std::uint64_t submissions_ = 0;
  std::atomic<std::uint64_t> made_buffers_ = 0, made_programs_ = 0;
  vk::raii::Instance instance_{nullptr};
  vk::raii::DebugUtilsMessengerEXT messenger_{nullptr};
  vk::raii::PhysicalDevice physical_{nullptr};
  std::uint32_t queue_family_ = 0;
  std::string name_;
  vk::PhysicalDeviceLimits limits_;
  DeviceLimits allows_{};
  bool is_cpu_ = false;
  bool had_gpu_ = false;  // since it was first opened
  mutable std::mutex drawing_mutex_;
  Drawing drawing_;
  vk::raii::Device device_{nullptr};
  vk::raii::Queue queue_{nullptr};
  vk::raii::CommandPool pool_{nullptr};
  vk::raii::CommandBuffer commands_{nullptr};
  vk::raii::Fence fence_{nullptr};
  PassClock clock_;
  std::mutex programs_mutex_;
  std::vector<Compiled> programs_;  // in the order in which they were last wanted
};

// A block of device memory, written and read through upload() and download(). `size` is in bytes;
// at least 16 are allocated, so that an empty array can still be bound.
struct Buffer {
  vk::raii::Buffer buffer{nullptr};
  vk::raii::DeviceMemory memory{nullptr};
  vk::raii::BufferView view{nullptr};  // texel buffers only
  vk::DeviceSize size = 0;
  void* mapped = nullptr;  // non-null where the memory is host-visible
};

Buffer create_storage_buffer(Device& device, vk::DeviceSize size);
Buffer create_indirect_buffer(Device& device, vk::DeviceSize size);
// Creates a buffer that shaders read as texels. It is written by uploads, or with `is_storage` by
// shaders, for which a device may allow less.
Buffer create_texel_buffer(Device& device, vk::DeviceSize size, vk::Format format,
                           bool is_storage = false);

// Uploads to `offset` (bytes). Throws previz::Error where the data would not fit.
void upload_bytes(Device& device, Buffer& buffer, std::span<const std::byte> bytes,
                  vk::DeviceSize offset = 0);
void download_bytes(Device& device, const Buffer& buffer, std::span<std::byte> bytes);
// Calls `visit` with the first `size` bytes: with the buffer's own memory if the host can read it,
// otherwise with a copy that is freed afterwards.
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

// Records commands that fill the buffers with zeros, and a barrier() after them.
void record_clear(const vk::raii::CommandBuffer& commands,
                  std::initializer_list<const Buffer*> buffers);

// Likewise for the first `bytes` of one buffer, a multiple of 4.
void record_clear(const vk::raii::CommandBuffer& commands, const Buffer& buffer,
                  vk::DeviceSize bytes);

// Makes what earlier dispatches and transfers wrote visible to later dispatches (and their indirect
// arguments) and transfers.
void barrier(const vk::raii::CommandBuffer& commands);

}  // namespace previz::render
