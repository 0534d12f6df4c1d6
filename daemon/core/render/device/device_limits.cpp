#include "daemon/core/render/device/device_limits.hpp"

#include <algorithm>
#include <initializer_list>

namespace previz::render {
namespace {

struct Need {
  const char* what;
  std::uint64_t asked, allowed;
};

std::optional<PastLimit> first_past(std::initializer_list<Need> needs) {
  for (const Need& need : needs)
    if (need.asked > need.allowed)
      return PastLimit{std::to_string(need.asked) + " " + need.what, need.allowed};
  return std::nullopt;
}

}  // namespace

DeviceLimits limits_of(const vk::raii::PhysicalDevice& physical) {
  const auto chain =
      physical.getProperties2<vk::PhysicalDeviceProperties2, vk::PhysicalDeviceVulkan11Properties,
                              vk::PhysicalDeviceVulkan13Properties>();
  const vk::PhysicalDeviceLimits& limits =
      chain.get<vk::PhysicalDeviceProperties2>().properties.limits;
  DeviceLimits result{};
  result.storage_buffers =
      std::min(limits.maxPerStageDescriptorStorageBuffers, limits.maxDescriptorSetStorageBuffers);
  // A uniform texel buffer counts as a sampled image.
  result.texel_buffers =
      std::min(limits.maxPerStageDescriptorSampledImages, limits.maxDescriptorSetSampledImages);
  result.buffers = limits.maxPerStageResources;
  result.group_invocations = limits.maxComputeWorkGroupInvocations;
  result.group_width = limits.maxComputeWorkGroupSize[0];
  result.push_bytes = limits.maxPushConstantsSize;
  result.buffer_bytes = chain.get<vk::PhysicalDeviceVulkan13Properties>().maxBufferSize;
  result.allocation_bytes =
      chain.get<vk::PhysicalDeviceVulkan11Properties>().maxMemoryAllocationSize;
  result.storage_bytes = limits.maxStorageBufferRange;
  result.texels = limits.maxTexelBufferElements;
  return result;
}

std::optional<PastLimit> past_limits(const DeviceLimits& limits, const SpirvInfo& pass,
                                     std::uint32_t push_bytes) {
  const auto count = [&](BufferKind kind) {
    return static_cast<std::uint64_t>(
        std::ranges::count(pass.bindings, kind, &SpirvInfo::Binding::kind));
  };
  const std::uint64_t storage = count(BufferKind::storage), texels = count(BufferKind::texels);
  const std::uint64_t all = pass.bindings.size();
  return first_past({{"storage buffers", storage, limits.storage_buffers},
                     {"texel buffers", texels, limits.texel_buffers},
                     {"buffers", all, limits.buffers},
                     {"invocations in a work group", pass.group_size, limits.group_invocations},
                     {"invocations across a work group", pass.group_size, limits.group_width},
                     {"bytes of push constants", push_bytes, limits.push_bytes}});
}

std::optional<PastLimit> past_limits(const DeviceLimits& limits, const BufferNeed& buffer) {
  const std::uint64_t storage = buffer.is_storage ? buffer.bytes : 0;
  return first_past({{"texels", buffer.texels, limits.texels},
                     {"bytes in a storage buffer", storage, limits.storage_bytes},
                     {"bytes in a buffer", buffer.bytes, limits.buffer_bytes},
                     {"bytes in an allocation", buffer.bytes, limits.allocation_bytes}});
}

}  // namespace previz::render
