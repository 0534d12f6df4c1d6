#include "daemon/render/photon_map.hpp"

#include <bit>
#include <cstddef>

#include "shaders/photon_bounce.spv.h"
#include "shaders/photon_buckets.spv.h"
#include "shaders/photon_emit.spv.h"
#include "shaders/photon_merge.spv.h"
#include "shaders/photon_scatter.spv.h"
#include "shaders/photon_sort.spv.h"

namespace previz::render {

void PhotonMap::resize(std::uint32_t photons) {
  photons_ = photons;
  // This must equal photon_bucket_count() of shaders/lib/photon_grid.glsl.
  bucket_count_ = std::bit_ceil(2 * photons);
  if (photons <= room_) return;  // fewer photons use a part of the buffers
  room_ = 0;                     // stays 0 if an allocation below throws
  const Purpose purpose(device_, "the photons", "lower estimator.photons");
  const vk::DeviceSize slots = 2 * static_cast<vk::DeviceSize>(photons);
  photon_buffer_ = create_storage_buffer(device_, slots * sizeof(gpu::GpuPhoton));
  order_ = create_storage_buffer(device_, slots * sizeof(std::uint32_t));
  filled_ = create_storage_buffer(device_, bucket_count_ * sizeof(std::uint32_t));
  control_ = create_indirect_buffer(device_, sizeof(gpu::GpuPhotonControl));
  sorted_ = create_texel_buffer(device_, slots * gpu::TEXELS_PER_PHOTON * sizeof(gpu::vec4),
                                vk::Format::eR32G32B32A32Sfloat, true);
  buckets_ = create_texel_buffer(device_, bucket_count_ * sizeof(gpu::GpuPhotonBucket),
                                 vk::Format::eR32G32Uint, true);
  room_ = photons;
}

std::span<const Pass> PhotonMap::passes() {
  static constexpr Pass all[] = {
      {"photon_emit", photon_emit_spv},       {"photon_bounce", photon_bounce_spv},
      {"photon_buckets", photon_buckets_spv}, {"photon_scatter", photon_scatter_spv},
      {"photon_sort", photon_sort_spv},       {"photon_merge", photon_merge_spv}};
  return all;
}

void PhotonMap::create_kernels(std::uint32_t features) {
  make_kernels({&emit_, &bounce_, &share_out_, &scatter_, &sort_, &merge_}, device_, passes(),
               features);
}

void PhotonMap::add_to(Buffers& buffers) const {
  buffers.insert({{"found_photons", &sorted_},
                  {"found_buckets", &buckets_},
                  {"photons", &photon_buffer_},
                  {"photon_order", &order_},
                  {"filled", &filled_},
                  {"photon_control", &control_},
                  {"sorted_photons", &sorted_},
                  {"buckets", &buckets_}});
}

void PhotonMap::record_emission(const Recording& recording) {
  record_clear(device_, recording.commands, {&buckets_, &filled_, &control_});
  emit_.dispatch(recording, photons_);
}

void PhotonMap::record_bounce(const Recording& recording, const Buffer& groups,
                              vk::DeviceSize offset) {
  bounce_.dispatch_indirect(recording, groups, offset);
}

// Large buckets are merged for as long as the largest that there can be needs; where there is none,
// nothing is dispatched.
void PhotonMap::record_sorting(const vk::raii::CommandBuffer& commands, gpu::GpuBatch batch,
                               const Buffers& buffers) {
  const Recording recording{commands, batch, buffers};
  share_out_.dispatch(recording, bucket_count_);
  scatter_.dispatch(recording, 2 * photons_);
  sort_.dispatch(recording, bucket_count_);
  const std::uint64_t most = 2 * std::uint64_t{photons_};
  batch.photon_merge = 0;
  for (std::uint64_t run = 1; run < most; run *= gpu::PHOTON_RUNS_MERGED, ++batch.photon_merge)
    merge_.dispatch_indirect({commands, batch, buffers}, control_,
                             offsetof(gpu::GpuPhotonControl, merge_groups));
}

}  // namespace previz::render
