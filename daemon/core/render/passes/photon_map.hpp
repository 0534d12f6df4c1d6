// Progressive photon mapping for caustics, in both worlds (P16; shaders/README.md, "Caustics"). One
// pass of photons serves the sample of the same index; the radius shrinks from pass to pass (Knaus
// and Zwicker 2011).
#pragma once

#include <cstdint>
#include <span>

#include "daemon/core/render/device/kernel.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

class PhotonMap {
 public:
  explicit PhotonMap(Device& device) : device_(device) { resize(1); }

  // Uses so many photons per pass; the buffers are made anew if there were never so many. `photons`
  // is at least 1, even where no photons are used.
  void resize(std::uint32_t photons);
  void create_kernels(std::uint32_t features);
  static std::span<const Pass> passes();  // of these kernels
  // Adds the map's buffers, for the passes that read the map and for the passes below.
  void add_to(Buffers& buffers) const;
  // These record a pass of photons, in this order: emission fills the queue of paths; after each
  // extension, as many work groups as `groups` holds at `offset` bounce the photons off what they
  // hit; sorting makes the map. All take the buffers of the scene and of the paths, and a GpuBatch
  // whose first_sample is the pass and whose photon_radius is the radius. The work of sorting does
  // not depend on where the photons are.
  std::uint32_t count() const { return photons_; }  // emitted a pass
  void record_emission(const Recording& recording);
  void record_bounce(const Recording& recording, const Buffer& groups, vk::DeviceSize offset);
  void record_sorting(const vk::raii::CommandBuffer& commands, gpu::GpuBatch batch,
                      const Buffers& buffers);

 private:
  Device& device_;
  Kernel emit_, bounce_, count_, scan_, place_, finish_;
  std::uint32_t photons_ = 0, bucket_count_ = 0;
  std::uint32_t room_ = 0;  // photons that the buffers have room for
  Buffer photon_buffer_, keys_, order_, counts_, control_, sorted_, buckets_;
};

}  // namespace previz::render
