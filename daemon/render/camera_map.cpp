#include "daemon/render/camera_map.hpp"

#include <array>

#include "shaders/camera_depth.spv.h"
#include "shaders/camera_usable.spv.h"
#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

bool is_plate_view(std::uint32_t binding) {
  return binding == gpu::BINDING_SEEN_RADIANCE;
}

}  // namespace

CameraMap::CameraMap(Device& device) : device_(device) {
  using Type = vk::DescriptorType;
  set_layout_ = create_set_layout(device, gpu::CAMERA_BINDINGS, [](std::uint32_t binding) {
    return is_plate_view(binding) ? Type::eUniformTexelBuffer : Type::eStorageBuffer;
  });
  const vk::DescriptorPoolSize sizes[] = {{Type::eUniformTexelBuffer, gpu::CAMERA_BINDINGS},
                                          {Type::eStorageBuffer, gpu::CAMERA_BINDINGS}};
  descriptors_ = vk::raii::DescriptorPool(
      device.vk(), {vk::DescriptorPoolCreateFlagBits::eFreeDescriptorSet, 1, sizes});
  const vk::DescriptorSetLayout raw = *set_layout_;
  set_ = std::move(vk::raii::DescriptorSets(device.vk(), {*descriptors_, raw}).front());
  resize(1);
}

void CameraMap::resize(std::uint32_t pixels) {
  if (pixels == pixels_) return;
  pixels_ = pixels;
  plate_ =
      create_texel_buffer(device_, pixels * sizeof(gpu::vec4), vk::Format::eR32G32B32A32Sfloat);
  seen_ = create_storage_buffer(device_, pixels * sizeof(gpu::GpuSeen));
  std::array<const Buffer*, gpu::CAMERA_BINDINGS> buffers{};
  buffers[gpu::BINDING_SEEN_RADIANCE] = &plate_;
  buffers[gpu::BINDING_PLATE] = &plate_;
  buffers[gpu::BINDING_SEEN] = &seen_;
  for (std::uint32_t binding = 0; binding < gpu::CAMERA_BINDINGS; ++binding)
    write_descriptor(device_, set_, binding, *buffers[binding], is_plate_view(binding));
}

void CameraMap::create_pipelines(const vk::raii::PipelineLayout& layout, std::uint32_t features) {
  const std::uint32_t constants[] = {features};
  depth_ = create_pipeline(device_, camera_depth_spv, layout, constants);
  usable_ = create_pipeline(device_, camera_usable_spv, layout, constants);
}

void CameraMap::upload(const std::vector<glm::vec4>& plate) {
  resize(static_cast<std::uint32_t>(plate.size()));
  upload_bytes(device_, plate_, std::as_bytes(std::span(plate)));
}

void CameraMap::record(const vk::raii::CommandBuffer& commands) const {
  for (const Pipeline* pass : {&depth_, &usable_}) {
    commands.bindPipeline(vk::PipelineBindPoint::eCompute, *pass->pipeline);
    commands.dispatch(work_groups(pixels_), 1, 1);
    barrier(commands);
  }
}

}  // namespace previz::render
