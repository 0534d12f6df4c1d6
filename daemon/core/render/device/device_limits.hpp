// Reads what a device allows, and says which limit a pass or a buffer is past.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vulkan/vulkan_raii.hpp>

#include "daemon/core/render/device/spirv.hpp"

namespace previz::render {

struct DeviceLimits {
  // These are limits of a pass.
  std::uint32_t storage_buffers, texel_buffers, buffers;
  std::uint32_t group_invocations, group_width, push_bytes;
  // These are limits of a buffer.
  std::uint64_t buffer_bytes, allocation_bytes, storage_bytes, texels;
};
DeviceLimits limits_of(const vk::raii::PhysicalDevice& physical);

// A need that is past what a device allows.
struct PastLimit {
  std::string asked;  // "600 texels"
  std::uint64_t allowed;
};

// The size of a buffer, and how passes use it.
struct BufferNeed {
  std::uint64_t bytes;
  std::uint64_t texels;  // 0: it is not read as texels
  bool is_storage;
};

// Return the first limit that is passed, if there is one. `push_bytes` are those of the pass's push
// constants.
std::optional<PastLimit> past_limits(const DeviceLimits& limits, const SpirvInfo& pass,
                                     std::uint32_t push_bytes);
std::optional<PastLimit> past_limits(const DeviceLimits& limits, const BufferNeed& buffer);

}  // namespace previz::render
