// The memory of a Vulkan device: buffers and texel views, and copies to and from them. Internal to
// the render room.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "daemon/core/render/device/device.hpp"
#include "daemon/core/render/device/purpose.hpp"

namespace previz::render {

// A block of device memory, written and read through upload() and download(). `size` is in bytes;
// at least 16 are allocated, so that an empty array can still be bound. It may go away while the
// device works with it: the memory is then freed when that is done.
struct Buffer {
  // In the order in which they are made.
  struct Parts {
    Sheet<std::byte> host;  // the memory that was imported; empty: it is the device's own
    vk::raii::Buffer buffer{nullptr};
    vk::raii::DeviceMemory memory{nullptr};
    vk::raii::BufferView view{nullptr};
    vk::raii::AccelerationStructureKHR structure{nullptr};
  };

  vk::Buffer buffer;
  vk::BufferView view;                     // texel buffers only
  vk::AccelerationStructureKHR structure;  // of create_structure_buffer() only
  vk::DeviceSize size = 0;
  void* mapped = nullptr;  // non-null where the host can write the memory
  std::uint64_t id = 0;    // no other buffer of the process has it
  std::unique_ptr<Parts, Retire<Parts>> parts;
};

// These throw previz::Error, with the device's name, the size and the purpose, where the device
// does not allow so large a buffer or has no memory for it.
Buffer create_storage_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size);
Buffer create_indirect_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size);
// Creates a buffer that all invocations read at the same places, which is quicker: 16 KiB at most.
Buffer create_uniform_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size);
// Creates a buffer that shaders fetch from (shaders/lib/fetch.glsl), as texels where the device
// reads texels. It is written by uploads, or with `is_storage` by shaders, for which a device may
// allow less.
Buffer create_texel_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size,
                           vk::Format format, bool is_storage = false);

// Create the same, for what has elements for every pixel of a picture and is worked on in bands: it
// may lie in a file (Device::use_scratch()).
Buffer create_picture_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size);
Buffer create_picture_texels(Device& device, const Purpose& purpose, vk::DeviceSize size,
                             vk::Format format);

// Creates memory for acceleration structures (daemon/core/render/world/ray_structures.hpp), or in
// which one is built. Where rays are traced in hardware, these can be built from all buffers of the
// device.
Buffer create_structure_memory(Device& device, const Purpose& purpose, vk::DeviceSize size);
// Creates such memory with one structure in it, which is still to be built.
Buffer create_structure_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size,
                               vk::AccelerationStructureTypeKHR type);

// The host's memory that copies go through, where the device's own is out of its reach. What goes
// up lies in a ring, whose memory is used again when the copies are done.
class Staging {
 public:
  explicit Staging(Device& device);

  // Returns host memory for bytes that a copy command, recorded next, will take up. No more than
  // most_at_once of them.
  struct Place {
    vk::Buffer buffer;
    vk::DeviceSize offset;
    std::byte* bytes;
  };
  Place take(vk::DeviceSize size);
  static constexpr vk::DeviceSize most_at_once = vk::DeviceSize{16} << 20;

  // Returns a buffer for a copy down, of at least this size. It must be given back.
  Buffer lend(vk::DeviceSize size);
  void give_back(Buffer buffer);

 private:
  struct Span {
    std::uint64_t submission;
    vk::DeviceSize end;  // in bytes that were ever taken
  };

  Device& device_;
  Buffer ring_;
  vk::DeviceSize head_ = 0, tail_ = 0;  // likewise: taken, and done with
  std::deque<Span> spans_;
  std::vector<Buffer> lent_;  // and given back
};

// Uploads to `offset` (bytes), behind what is recorded so far. Throws previz::Error where the data
// would not fit.
void upload_bytes(Device& device, Buffer& buffer, std::span<const std::byte> bytes,
                  vk::DeviceSize offset = 0);
void download_bytes(Device& device, const Buffer& buffer, std::span<std::byte> bytes);
// Calls `visit` with the first `size` bytes: with the buffer's own memory if the host can read it,
// otherwise with a copy.
void read_bytes(Device& device, const Buffer& buffer, vk::DeviceSize size,
                const std::function<void(const std::byte*)>& visit);

// Copies that come down behind what is recorded so far, and that the host does not wait for yet.
class Downloads {
 public:
  // Copies the buffer's first bytes as they are now. `to` is written by finish(), or at once, and
  // must stay where it is until then. A later copy to the same place replaces the earlier one.
  void add(Device& device, const Buffer& buffer, std::span<std::byte> to);
  // Waits until all copies are here.
  void finish();
  bool are_here() const { return copies_.empty(); }
  // Returns whether they were handed over and are not known to be done: finish() would wait for all
  // that was handed over with them.
  bool are_under_way() const;

 private:
  struct Copy {
    Buffer staging;
    std::span<std::byte> to;
  };
  Device* device_ = nullptr;
  std::uint64_t submission_ = 0;  // the last copy's
  std::vector<Copy> copies_;
};

// (Re)create `buffer` where it is too small, then upload.
template <typename T>
void upload_storage(Device& device, const Purpose& purpose, Buffer& buffer,
                    const std::vector<T>& data) {
  const vk::DeviceSize size = data.size() * sizeof(T);
  if (!buffer.buffer || buffer.size < size) buffer = create_storage_buffer(device, purpose, size);
  upload_bytes(device, buffer, std::as_bytes(std::span(data)));
}
template <typename T>
void upload_uniform(Device& device, const Purpose& purpose, Buffer& buffer, const T& data) {
  if (!buffer.buffer) buffer = create_uniform_buffer(device, purpose, sizeof(T));
  upload_bytes(device, buffer, std::as_bytes(std::span(&data, 1)));
}
template <typename T>
void upload_texels(Device& device, const Purpose& purpose, Buffer& buffer,
                   const std::vector<T>& data, vk::Format format) {
  const vk::DeviceSize size = data.size() * sizeof(T);
  if (!buffer.buffer || buffer.size < size)
    buffer = create_texel_buffer(device, purpose, size, format);
  upload_bytes(device, buffer, std::as_bytes(std::span(data)));
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

// Records commands that fill the buffers with zeros, and a barrier after them.
void record_clear(Device& device, const vk::raii::CommandBuffer& commands,
                  std::initializer_list<const Buffer*> buffers);

// Likewise for the first `bytes` of one buffer, a multiple of 4.
void record_clear(Device& device, const vk::raii::CommandBuffer& commands, const Buffer& buffer,
                  vk::DeviceSize bytes);

}  // namespace previz::render
