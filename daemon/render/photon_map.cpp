#include "daemon/render/photon_map.hpp"

#include <bit>

#include "shaders/lib/render_shared.h"
#include "shaders/photon_buckets.spv.h"
#include "shaders/photon_scatter.spv.h"
#include "shaders/photon_sort.spv.h"
#include "shaders/photon_trace.spv.h"

namespace previz::render {

PhotonMap::PhotonMap(Device& device) : device_(device) {
  set_layout_ = create_set_layout(device, gpu::PHOTON_BINDINGS,
                                  [](std::uint32_t) { return vk::DescriptorType::eStorageBuffer; });
  const vk::DescriptorPoolSize size(vk::DescriptorType::eStorageBuffer, gpu::PHOTON_BINDINGS);
  descriptors_ = vk::raii::DescriptorPool(
      device.vk(), {vk::DescriptorPoolCreateFlagBits::eFreeDescriptorSet, 1, size});
  const vk::DescriptorSetLayout raw = *set_layout_;
  set_ = std::move(vk::raii::DescriptorSets(device.vk(), {*descriptors_, raw}).front());
  resize(1);
}

void PhotonMap::resize(std::uint32_t photons) {
  if (photons == photons_) return;
  photons_ = photons;
  bucket_count_ = std::bit_ceil(2 * photons);
  const vk::DeviceSize slots = 2 * static_cast<vk::DeviceSize>(photons);
  photon_buffer_ = create_storage_buffer(device_, slots * sizeof(gpu::GpuPhoton));
  order_ = create_storage_buffer(device_, slots * sizeof(std::uint32_t));
  buckets_ = create_storage_buffer(device_, bucket_count_ * sizeof(gpu::GpuPhotonBucket));
  control_ = create_storage_buffer(device_, sizeof(gpu::GpuPhotonControl));
  const auto write = [&](std::uint32_t binding, const Buffer& buffer, vk::DeviceSize size) {
    const vk::DescriptorBufferInfo info(*buffer.buffer, 0, size);
    device_.vk().updateDescriptorSets(
        vk::WriteDescriptorSet(*set_, binding, 0, vk::DescriptorType::eStorageBuffer, {}, info),
        {});
  };
  // Exact ranges: the shaders read the arrays' lengths from them.
  write(gpu::BINDING_PHOTONS, photon_buffer_, slots * sizeof(gpu::GpuPhoton));
  write(gpu::BINDING_PHOTON_ORDER, order_, slots * sizeof(std::uint32_t));
  write(gpu::BINDING_PHOTON_BUCKETS, buckets_, bucket_count_ * sizeof(gpu::GpuPhotonBucket));
  write(gpu::BINDING_PHOTON_CONTROL, control_, sizeof(gpu::GpuPhotonControl));
}

void PhotonMap::create_pipelines(const vk::raii::PipelineLayout& layout, std::uint32_t features) {
  const std::uint32_t constants[] = {features};
  trace_ = create_pipeline(device_, photon_trace_spv, layout, constants);
  buckets_pass_ = create_pipeline(device_, photon_buckets_spv, layout, constants);
  scatter_ = create_pipeline(device_, photon_scatter_spv, layout, constants);
  sort_ = create_pipeline(device_, photon_sort_spv, layout, constants);
}

void PhotonMap::record(const vk::raii::CommandBuffer& commands) const {
  const auto dispatch = [&](const Pipeline& pipeline, std::uint32_t invocations) {
    commands.bindPipeline(vk::PipelineBindPoint::eCompute, *pipeline.pipeline);
    commands.dispatch(work_groups(invocations), 1, 1);
    barrier(commands);
  };
  commands.fillBuffer(*buckets_.buffer, 0, VK_WHOLE_SIZE, 0);
  commands.fillBuffer(*control_.buffer, 0, VK_WHOLE_SIZE, 0);
  barrier(commands);
  dispatch(trace_, photons_);
  dispatch(buckets_pass_, bucket_count_);
  dispatch(scatter_, 2 * photons_);
  dispatch(sort_, bucket_count_);
}

}  // namespace previz::render
