#include "daemon/core/render/passes/photon_map.hpp"

#include <bit>

#include "shaders/photon_bounce.spv.h"
#include "shaders/photon_buckets.spv.h"
#include "shaders/photon_count.spv.h"
#include "shaders/photon_emit.spv.h"
#include "shaders/photon_place.spv.h"
#include "shaders/photon_scan.spv.h"

namespace previz::render {
namespace {

// Returns how many blocks the photons and their forks make, each moved by a work group of the sort.
std::uint32_t sort_block_count(std::uint32_t photons) {
  constexpr std::uint32_t keys = gpu::PHOTON_RUN * gpu::WORKGROUP_SIZE;
  return (2 * photons + keys - 1) / keys;
}

}  // namespace

void PhotonMap::resize(std::uint32_t photons) {
  photons_ = photons;
  // This must equal photon_bucket_count() of shaders/lib/photon_grid.glsl.
  bucket_count_ = std::bit_ceil(2 * photons);
  if (photons <= room_) return;  // fewer photons use a part of the buffers
  room_ = 0;                     // stays 0 if an allocation below throws
  const Purpose purpose{"the photons", "lower estimator.photons"};
  const vk::DeviceSize slots = 2 * static_cast<vk::DeviceSize>(photons);
  photon_buffer_ = create_storage_buffer(device_, purpose, slots * sizeof(gpu::GpuPhoton));
  keys_ = create_storage_buffer(device_, purpose, slots * sizeof(std::uint32_t));
  order_ = create_storage_buffer(device_, purpose, 2 * slots * sizeof(gpu::uvec2));
  counts_ = create_storage_buffer(
      device_, purpose,
      vk::DeviceSize{sort_block_count(photons)} * gpu::PHOTON_DIGITS * sizeof(std::uint32_t));
  control_ = create_storage_buffer(device_, purpose, sizeof(gpu::GpuPhotonControl));
  sorted_ =
      create_texel_buffer(device_, purpose, slots * gpu::TEXELS_PER_PHOTON * sizeof(gpu::vec4),
                          vk::Format::eR32G32B32A32Sfloat, true);
  buckets_ = create_texel_buffer(device_, purpose, bucket_count_ * sizeof(gpu::GpuPhotonBucket),
                                 vk::Format::eR32G32Uint, true);
  room_ = photons;
}

std::span<const Pass> PhotonMap::passes() {
  static constexpr Pass all[] = {
      {"photon_emit", photon_emit_spv},   {"photon_bounce", photon_bounce_spv},
      {"photon_count", photon_count_spv}, {"photon_scan", photon_scan_spv},
      {"photon_place", photon_place_spv}, {"photon_buckets", photon_buckets_spv}};
  return all;
}

void PhotonMap::create_kernels(std::uint32_t features) {
  make_kernels({&emit_, &bounce_, &count_, &scan_, &place_, &finish_}, device_, passes(), features);
}

void PhotonMap::add_to(Buffers& buffers) const {
  buffers.insert({{"found_photons", &sorted_},
                  {"found_buckets", &buckets_},
                  {"photons", &photon_buffer_},
                  {"photon_keys", &keys_},
                  {"photon_order", &order_},
                  {"photon_counts", &counts_},
                  {"photon_control", &control_},
                  {"sorted_photons", &sorted_},
                  {"buckets", &buckets_}});
}

void PhotonMap::record_emission(const Recording& recording) {
  record_clear(device_, recording.commands, {&buckets_, &control_});
  emit_.dispatch(recording, photons_);
}

void PhotonMap::record_bounce(const Recording& recording, const Buffer& groups,
                              vk::DeviceSize offset) {
  bounce_.dispatch_indirect(recording, groups, offset);
}

// All dispatches are as large as if all photons were stored, and forked; the work groups past those
// that are stored end at once.
void PhotonMap::record_sorting(const vk::raii::CommandBuffer& commands, gpu::GpuBatch batch,
                               const Buffers& buffers) {
  const std::uint32_t block_invocations = sort_block_count(photons_) * gpu::WORKGROUP_SIZE;
  const std::uint32_t bits = std::bit_width(bucket_count_ - 1);
  batch.photon_digit = 0;
  for (; batch.photon_digit * gpu::PHOTON_DIGIT_BITS < bits; ++batch.photon_digit) {
    const Recording recording{commands, batch, buffers};
    count_.dispatch(recording, block_invocations);
    scan_.dispatch(recording, gpu::PHOTON_DIGITS * gpu::WORKGROUP_SIZE);
    place_.dispatch(recording, block_invocations);
  }
  finish_.dispatch({commands, batch, buffers}, 2 * photons_);
}

}  // namespace previz::render
