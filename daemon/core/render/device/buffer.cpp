#include "daemon/core/render/device/buffer.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <utility>

#include "drivers/error.hpp"

namespace previz::render {
namespace {

std::string size_words(vk::DeviceSize bytes) {
  if (bytes < 1'000'000) return std::to_string(bytes) + " bytes";
  char text[32];
  const auto size = static_cast<double>(bytes);
  std::snprintf(text, sizeof(text), bytes < 1'000'000'000 ? "%.1f MB" : "%.1f GB",
                size / (bytes < 1'000'000'000 ? 1e6 : 1e9));
  return text;
}

// "a buffer of 34.1 MB for the photons"
std::string buffer_words(const Purpose& purpose, vk::DeviceSize size) {
  return "a buffer of " + size_words(size) + " for " + purpose.words();
}

// Throws previz::Error where the device does not allow so large a buffer.
void check_buffer(const Device& device, const Purpose& purpose, const BufferNeed& need) {
  if (const auto past = past_limits(device.allows(), need))
    throw Error("Vulkan: " + buffer_words(purpose, need.bytes) + " needs " + past->asked +
                ", but " + device.name() + " allows " + std::to_string(past->allowed) + "; " +
                purpose.advice);
}

std::uint64_t next_id() {
  static std::atomic<std::uint64_t> last = 0;
  return ++last;
}

// What a buffer is made of.
struct Kind {
  vk::BufferUsageFlags usage;
  vk::MemoryPropertyFlags wanted, preferred;
  bool in_scratch = false;
};

constexpr auto host_allocation = vk::ExternalMemoryHandleTypeFlagBits::eHostAllocationEXT;

// Gives the buffer memory that lies in a file.
void bind_scratch(Device& device, Buffer::Parts& parts, const vk::MemoryRequirements& needed,
                  const Kind& kind) {
  const vk::DeviceSize page = Scratch::alignment();
  parts.host = Sheet<std::byte>((needed.size + page - 1) / page * page,
                                SheetAllocator<std::byte>(device.scratch()));
  const auto types = device.vk()
                         .getMemoryHostPointerPropertiesEXT(host_allocation, parts.host.data())
                         .memoryTypeBits;
  const auto type = device.memory().type(types & needed.memoryTypeBits, {}, {});
  vk::ImportMemoryHostPointerInfoEXT import(host_allocation, parts.host.data());
  const vk::MemoryAllocateFlagsInfo with_address(vk::MemoryAllocateFlagBits::eDeviceAddress);
  if (kind.usage & vk::BufferUsageFlagBits::eShaderDeviceAddress) import.pNext = &with_address;
  parts.memory =
      vk::raii::DeviceMemory(device.vk(), vk::MemoryAllocateInfo(parts.host.size(), type, &import));
}

void* bind_own(Device& device, Buffer::Parts& parts, const vk::MemoryRequirements& needed,
               const Kind& kind) {
  std::uint32_t types = needed.memoryTypeBits;
  vk::MemoryPropertyFlags wanted = kind.wanted;
  const bool is_own = static_cast<bool>(wanted & vk::MemoryPropertyFlagBits::eDeviceLocal);
  if (is_own && (types & device.memory().mapped_types()) != 0) {
    types &= device.memory().mapped_types();
    wanted |= vk::MemoryPropertyFlagBits::eHostVisible;
  }
  const auto type = device.memory().type(types, wanted, kind.preferred);
  const vk::MemoryAllocateFlagsInfo with_address(vk::MemoryAllocateFlagBits::eDeviceAddress);
  vk::MemoryAllocateInfo allocate(needed.size, type);
  if (kind.usage & vk::BufferUsageFlagBits::eShaderDeviceAddress) allocate.pNext = &with_address;
  parts.memory = vk::raii::DeviceMemory(device.vk(), allocate);
  return wanted & vk::MemoryPropertyFlagBits::eHostVisible
             ? parts.memory.mapMemory(0, VK_WHOLE_SIZE)
             : nullptr;
}

Buffer create_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size,
                     const Kind& kind) {
  using Usage = vk::BufferUsageFlagBits;
  device.submissions().finish();  // what is no longer needed is freed first
  Buffer result;
  result.size = std::max<vk::DeviceSize>((size + 15) / 16 * 16, 16);
  result.parts = {new Buffer::Parts, Retire<Buffer::Parts>{&device}};
  const vk::ExternalMemoryBufferCreateInfo imported(host_allocation);
  vk::BufferCreateInfo info({}, result.size,
                            kind.usage | Usage::eTransferSrc | Usage::eTransferDst);
  if (kind.in_scratch) info.pNext = &imported;
  try {
    Buffer::Parts& parts = *result.parts;
    parts.buffer = vk::raii::Buffer(device.vk(), info);
    const vk::MemoryRequirements needed = parts.buffer.getMemoryRequirements();
    if (kind.in_scratch) {
      bind_scratch(device, parts, needed, kind);
      result.mapped = parts.host.data();
    } else {
      result.mapped = bind_own(device, parts, needed, kind);
    }
    parts.buffer.bindMemory(*parts.memory, 0);
  } catch (const vk::DeviceLostError&) {
    throw;
  } catch (const vk::SystemError& error) {
    const bool is_full = error.code() == vk::Result::eErrorOutOfDeviceMemory;
    throw Error("Vulkan: " + device.name() + (is_full ? " is out of memory" : " has no room") +
                " for " + buffer_words(purpose, result.size) +
                (is_full ? "" : std::string(": ") + error.what()) + "; " + purpose.advice);
  }
  ++device.submissions().work.allocations;
  result.buffer = *result.parts->buffer;
  result.id = next_id();
  return result;
}

using Memory = vk::MemoryPropertyFlagBits;

// Where the host works in the device's memory, or can write it, it is mapped.
Buffer create_device_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size,
                            vk::BufferUsageFlags usage, bool is_of_picture = false) {
  using Usage = vk::BufferUsageFlagBits;
  device.memory().count_buffer();
  if (device.traces_in_hardware())
    usage |= Usage::eShaderDeviceAddress | Usage::eAccelerationStructureBuildInputReadOnlyKHR;
  const vk::MemoryPropertyFlags host = Memory::eHostVisible | Memory::eHostCoherent;
  if (!device.shares_host_memory())
    return create_buffer(device, purpose, size, {usage, Memory::eDeviceLocal, {}});
  const bool in_scratch = is_of_picture && device.scratch() && device.imports_host_memory();
  return create_buffer(device, purpose, size, {usage, host, Memory::eDeviceLocal, in_scratch});
}

Buffer create_staging_buffer(Device& device, vk::DeviceSize size,
                             vk::MemoryPropertyFlags preferred) {
  constexpr Purpose purpose{"copies to and from the graphics card",
                            "close other programs, or make the picture smaller"};
  return create_buffer(device, purpose, size,
                       {{}, Memory::eHostVisible | Memory::eHostCoherent, preferred});
}

vk::DeviceSize texel_bytes_of(vk::Format format) {
  switch (format) {
    case vk::Format::eR32Sfloat:
    case vk::Format::eR32Uint:
      return 4;
    case vk::Format::eR32G32Sfloat:
    case vk::Format::eR32G32Uint:
    case vk::Format::eR16G16B16A16Sfloat:
      return 8;
    case vk::Format::eR32G32B32A32Sfloat:
    case vk::Format::eR32G32B32A32Uint:
      return 16;
    default:
      throw Error("Vulkan: no texel buffer of format " + vk::to_string(format));
  }
}

Staging& staging_of(Device& device) {
  std::shared_ptr<Staging>& staging = device.memory().staging();
  if (!staging) staging = std::make_shared<Staging>(device);
  return *staging;
}

// Returns whether the host can write the buffer in place. A card may still be working with it,
// unless it has nothing at all to do, as after every creation of a buffer.
bool can_write_now(Device& device, const Buffer& buffer) {
  return buffer.mapped && (device.shares_host_memory() || device.submissions().is_idle());
}

// Copies down, and makes what was copied visible to the host. What the device writes next waits
// until it was read.
void record_copy_down(Device& device, const Buffer& from, const Buffer& to, vk::DeviceSize size) {
  device.record([&](const vk::raii::CommandBuffer& commands) {
    device.clock().start(commands, "copy down");
    commands.copyBuffer(from.buffer, to.buffer, vk::BufferCopy(0, 0, size));
    device.clock().stop(commands);
    using Stage = vk::PipelineStageFlagBits2;
    const vk::MemoryBarrier2 to_host(
        Stage::eCopy, vk::AccessFlagBits2::eTransferWrite,
        Stage::eHost | Stage::eComputeShader | Stage::eCopy | Stage::eClear,
        vk::AccessFlagBits2::eHostRead | vk::AccessFlagBits2::eTransferWrite);
    commands.pipelineBarrier2(vk::DependencyInfo({}, to_host));
  });
  DeviceWork& work = device.submissions().work;
  ++work.barriers;
  work.bytes_down += size;
}

}  // namespace

namespace {

Buffer storage_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size,
                      bool is_of_picture) {
  check_buffer(device, purpose, {size, 0, true});
  return create_device_buffer(device, purpose, size, vk::BufferUsageFlagBits::eStorageBuffer,
                              is_of_picture);
}

Buffer texel_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size, vk::Format format,
                    bool is_storage, bool is_of_picture) {
  using Usage = vk::BufferUsageFlagBits;
  if (device.reads_storage()) return storage_buffer(device, purpose, size, is_of_picture);
  check_buffer(device, purpose, {size, size / texel_bytes_of(format), is_storage});
  Buffer result = create_device_buffer(
      device, purpose, size, Usage::eUniformTexelBuffer | Usage::eStorageBuffer, is_of_picture);
  result.parts->view =
      vk::raii::BufferView(device.vk(), {{}, result.buffer, format, 0, VK_WHOLE_SIZE});
  result.view = *result.parts->view;
  return result;
}

}  // namespace

Buffer create_storage_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size) {
  return storage_buffer(device, purpose, size, false);
}

Buffer create_picture_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size) {
  return storage_buffer(device, purpose, size, true);
}

Buffer create_indirect_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size) {
  return create_device_buffer(
      device, purpose, size,
      vk::BufferUsageFlagBits::eStorageBuffer | vk::BufferUsageFlagBits::eIndirectBuffer);
}

Buffer create_uniform_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size) {
  return create_device_buffer(device, purpose, size, vk::BufferUsageFlagBits::eUniformBuffer);
}

Buffer create_texel_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size,
                           vk::Format format, bool is_storage) {
  return texel_buffer(device, purpose, size, format, is_storage, false);
}

Buffer create_picture_texels(Device& device, const Purpose& purpose, vk::DeviceSize size,
                             vk::Format format) {
  return texel_buffer(device, purpose, size, format, true, true);
}

Buffer create_structure_memory(Device& device, const Purpose& purpose, vk::DeviceSize size) {
  check_buffer(device, purpose, {size, 0, false});
  return create_device_buffer(device, purpose, size,
                              vk::BufferUsageFlagBits::eStorageBuffer |
                                  vk::BufferUsageFlagBits::eAccelerationStructureStorageKHR);
}

Buffer create_structure_buffer(Device& device, const Purpose& purpose, vk::DeviceSize size,
                               vk::AccelerationStructureTypeKHR type) {
  Buffer result = create_structure_memory(device, purpose, size);
  result.parts->structure = vk::raii::AccelerationStructureKHR(
      device.vk(), vk::AccelerationStructureCreateInfoKHR({}, result.buffer, 0, result.size, type));
  result.structure = *result.parts->structure;
  return result;
}

// Three frames of 1920x1080 with 16 bits a channel are under way, and what else they need.
constexpr vk::DeviceSize ring_bytes = vk::DeviceSize{64} << 20;
// What is lent for a copy down is kept for the next one if it is no larger: a picture of 3840x2160.
constexpr vk::DeviceSize most_kept = vk::DeviceSize{64} << 20;

Staging::Staging(Device& device)
    : device_(device), ring_(create_staging_buffer(device, ring_bytes, {})) {}

Staging::Place Staging::take(vk::DeviceSize size) {
  size = (size + 15) / 16 * 16;
  vk::DeviceSize first = head_;
  if (first % ring_bytes + size > ring_bytes) first += ring_bytes - first % ring_bytes;
  Submissions& submissions = device_.submissions();
  for (; first + size - tail_ > ring_bytes; spans_.pop_front()) {
    submissions.wait(spans_.front().submission);
    tail_ = spans_.front().end;
  }
  head_ = first + size;
  if (spans_.empty() || spans_.back().submission != submissions.next())
    spans_.push_back({submissions.next(), head_});
  spans_.back().end = head_;
  const vk::DeviceSize offset = first % ring_bytes;
  return {ring_.buffer, offset, static_cast<std::byte*>(ring_.mapped) + offset};
}

Buffer Staging::lend(vk::DeviceSize size) {
  const auto fits = [&](const Buffer& buffer) { return buffer.size >= size; };
  const auto found = std::ranges::find_if(lent_, fits);
  if (found == lent_.end()) return create_staging_buffer(device_, size, Memory::eHostCached);
  Buffer buffer = std::move(*found);
  lent_.erase(found);
  return buffer;
}

void Staging::give_back(Buffer buffer) {
  if (buffer.size > most_kept) return;
  const auto larger =
      std::ranges::find_if(lent_, [&](const Buffer& other) { return other.size > buffer.size; });
  lent_.insert(larger, std::move(buffer));
}

void upload_bytes(Device& device, Buffer& buffer, std::span<const std::byte> bytes,
                  vk::DeviceSize offset) {
  if (bytes.empty()) return;
  if (offset + bytes.size() > buffer.size) throw Error("Vulkan: upload past a buffer's end");
  device.submissions().work.bytes_up += bytes.size();
  if (can_write_now(device, buffer)) {
    std::memcpy(static_cast<std::byte*>(buffer.mapped) + offset, bytes.data(), bytes.size());
    return;
  }
  for (std::size_t done = 0; done < bytes.size(); done += Staging::most_at_once) {
    const std::span part =
        bytes.subspan(done, std::min<std::size_t>(Staging::most_at_once, bytes.size() - done));
    const Staging::Place place = staging_of(device).take(part.size());
    std::memcpy(place.bytes, part.data(), part.size());
    device.record([&](const vk::raii::CommandBuffer& commands) {
      device.clock().start(commands, "copy up");
      commands.copyBuffer(place.buffer, buffer.buffer,
                          vk::BufferCopy(place.offset, offset + done, part.size()));
      device.clock().stop(commands);
      device.submissions().barrier(commands);
    });
  }
}

void read_bytes(Device& device, const Buffer& buffer, vk::DeviceSize size,
                const std::function<void(const std::byte*)>& visit) {
  if (size == 0) return;
  if (device.shares_host_memory()) {
    device.submissions().work.bytes_down += size;
    visit(static_cast<const std::byte*>(buffer.mapped));
    return;
  }
  Buffer staging = staging_of(device).lend(size);
  record_copy_down(device, buffer, staging, size);
  device.submissions().finish();
  visit(static_cast<const std::byte*>(staging.mapped));
  staging_of(device).give_back(std::move(staging));
}

void download_bytes(Device& device, const Buffer& buffer, std::span<std::byte> bytes) {
  read_bytes(device, buffer, bytes.size(),
             [&](const std::byte* from) { std::memcpy(bytes.data(), from, bytes.size()); });
}

void Downloads::add(Device& device, const Buffer& buffer, std::span<std::byte> to) {
  if (device.shares_host_memory()) return download_bytes(device, buffer, to);
  const auto same =
      std::ranges::find(copies_, to.data(), [](const Copy& copy) { return copy.to.data(); });
  Copy& copy = same != copies_.end()
                   ? *same
                   : copies_.emplace_back(Copy{staging_of(device).lend(to.size()), to});
  record_copy_down(device, buffer, copy.staging, to.size());
  device_ = &device;
  submission_ = device.submissions().next();
}

bool Downloads::are_under_way() const {
  return !are_here() && submission_ > device_->submissions().done() &&
         submission_ < device_->submissions().next();
}

void Downloads::finish() {
  if (copies_.empty()) return;
  device_->submissions().wait(submission_);
  for (Copy& copy : copies_) {
    std::memcpy(copy.to.data(), copy.staging.mapped, copy.to.size());
    staging_of(*device_).give_back(std::move(copy.staging));
  }
  copies_.clear();
}

void record_clear(Device& device, const vk::raii::CommandBuffer& commands,
                  std::initializer_list<const Buffer*> buffers) {
  for (const Buffer* buffer : buffers) commands.fillBuffer(buffer->buffer, 0, VK_WHOLE_SIZE, 0);
  device.submissions().barrier(commands);
}

void record_clear(Device& device, const vk::raii::CommandBuffer& commands, const Buffer& buffer,
                  vk::DeviceSize bytes) {
  commands.fillBuffer(buffer.buffer, 0, bytes, 0);
  device.submissions().barrier(commands);
}

std::optional<CopySpeed> copy_speed(Device& device) {
  if (device.shares_host_memory()) return std::nullopt;
  std::vector<std::byte> bytes(std::size_t{64} << 20);
  constexpr Purpose purpose{"the measurement of copies", "close other programs"};
  Buffer buffer = create_storage_buffer(device, purpose, bytes.size());
  const auto bytes_a_second = [&](const auto& copy) {
    copy();  // makes the staging memory
    const auto start = std::chrono::steady_clock::now();
    constexpr int copies = 4;
    for (int i = 0; i < copies; ++i) copy();
    device.submissions().finish();
    return copies * static_cast<double>(bytes.size()) /
           std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  return CopySpeed{.up_bytes_s = bytes_a_second([&] { upload_bytes(device, buffer, bytes); }),
                   .down_bytes_s = bytes_a_second([&] { download_bytes(device, buffer, bytes); })};
}

}  // namespace previz::render
