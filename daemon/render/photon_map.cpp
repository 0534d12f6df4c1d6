#include "daemon/render/photon_map.hpp"

#include <array>
#include <bit>

#include "shaders/lib/render_shared.h"
#include "shaders/photon_bounce.spv.h"
#include "shaders/photon_buckets.spv.h"
#include "shaders/photon_emit.spv.h"
#include "shaders/photon_scatter.spv.h"
#include "shaders/photon_sort.spv.h"

namespace previz::render {
namespace {

bool is_texel_view(std::uint32_t binding) {
  return binding < gpu::BINDING_PHOTONS;
}

}  // namespace

PhotonMap::PhotonMap(Device& device) : device_(device) {
  using Type = vk::DescriptorType;
  set_layout_ = create_set_layout(device, gpu::PHOTON_BINDINGS, [](std::uint32_t binding) {
    return is_texel_view(binding) ? Type::eUniformTexelBuffer : Type::eStorageBuffer;
  });
  const vk::DescriptorPoolSize sizes[] = {{Type::eUniformTexelBuffer, gpu::PHOTON_BINDINGS},
                                          {Type::eStorageBuffer, gpu::PHOTON_BINDINGS}};
  descriptors_ = vk::raii::DescriptorPool(
      device.vk(), {vk::DescriptorPoolCreateFlagBits::eFreeDescriptorSet, 1, sizes});
  const vk::DescriptorSetLayout raw = *set_layout_;
  set_ = std::move(vk::raii::DescriptorSets(device.vk(), {*descriptors_, raw}).front());
  resize(1);
}

void PhotonMap::resize(std::uint32_t photons) {
  if (photons == photons_) return;
  photons_ = photons;
  // As photon_bucket_count() of shaders/lib/photon_grid.glsl.
  bucket_count_ = std::bit_ceil(2 * photons);
  const vk::DeviceSize slots = 2 * static_cast<vk::DeviceSize>(photons);
  photon_buffer_ = create_storage_buffer(device_, slots * sizeof(gpu::GpuPhoton));
  order_ = create_storage_buffer(device_, slots * sizeof(std::uint32_t));
  filled_ = create_storage_buffer(device_, bucket_count_ * sizeof(std::uint32_t));
  control_ = create_storage_buffer(device_, sizeof(gpu::GpuPhotonControl));
  sorted_ = create_texel_buffer(device_, slots * gpu::TEXELS_PER_PHOTON * sizeof(gpu::vec4),
                                vk::Format::eR32G32B32A32Sfloat);
  buckets_ = create_texel_buffer(device_, bucket_count_ * sizeof(gpu::GpuPhotonBucket),
                                 vk::Format::eR32G32Uint);
  write_set();
}

void PhotonMap::write_set() const {
  std::array<const Buffer*, gpu::PHOTON_BINDINGS> buffers{};
  buffers[gpu::BINDING_FOUND_PHOTONS] = &sorted_;
  buffers[gpu::BINDING_FOUND_BUCKETS] = &buckets_;
  buffers[gpu::BINDING_PHOTONS] = &photon_buffer_;
  buffers[gpu::BINDING_PHOTON_ORDER] = &order_;
  buffers[gpu::BINDING_PHOTON_FILLED] = &filled_;
  buffers[gpu::BINDING_PHOTON_CONTROL] = &control_;
  buffers[gpu::BINDING_PHOTON_SORTED] = &sorted_;
  buffers[gpu::BINDING_PHOTON_BUCKETS] = &buckets_;
  for (std::uint32_t binding = 0; binding < gpu::PHOTON_BINDINGS; ++binding)
    write_descriptor(device_, set_, binding, *buffers[binding], is_texel_view(binding));
}

void PhotonMap::create_pipelines(const vk::raii::PipelineLayout& layout, std::uint32_t features) {
  const std::uint32_t constants[] = {features};
  emit_ = create_pipeline(device_, photon_emit_spv, layout, constants);
  bounce_ = create_pipeline(device_, photon_bounce_spv, layout, constants);
  share_out_ = create_pipeline(device_, photon_buckets_spv, layout, constants);
  scatter_ = create_pipeline(device_, photon_scatter_spv, layout, constants);
  sort_ = create_pipeline(device_, photon_sort_spv, layout, constants);
}

void PhotonMap::dispatch(const vk::raii::CommandBuffer& commands, const Pipeline& pipeline,
                         std::uint32_t invocations) {
  commands.bindPipeline(vk::PipelineBindPoint::eCompute, *pipeline.pipeline);
  commands.dispatch(work_groups(invocations), 1, 1);
  barrier(commands);
}

void PhotonMap::record_emission(const vk::raii::CommandBuffer& commands) const {
  for (const Buffer* emptied : {&buckets_, &filled_, &control_})
    commands.fillBuffer(*emptied->buffer, 0, VK_WHOLE_SIZE, 0);
  barrier(commands);
  dispatch(commands, emit_, photons_);
}

void PhotonMap::bind_bounce(const vk::raii::CommandBuffer& commands) const {
  commands.bindPipeline(vk::PipelineBindPoint::eCompute, *bounce_.pipeline);
}

void PhotonMap::record_sorting(const vk::raii::CommandBuffer& commands) const {
  dispatch(commands, share_out_, bucket_count_);
  dispatch(commands, scatter_, 2 * photons_);
  dispatch(commands, sort_, bucket_count_);
}

}  // namespace previz::render
