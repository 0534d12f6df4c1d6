// Photons for caustics: progressive photon mapping in both worlds (P16). One pass of photons serves
// the sample of the same index; the radius shrinks from pass to pass (Knaus and Zwicker 2011).
#pragma once

#include <cstdint>

#include "daemon/render/device.hpp"

namespace previz::render {

class PhotonMap {
 public:
  // Pipeline layouts of the passes have this at set 2.
  explicit PhotonMap(Device& device);
  const vk::raii::DescriptorSetLayout& set_layout() const { return set_layout_; }
  vk::DescriptorSet set() const { return *set_; }

  // (Re)creates the buffers where `photons` a pass differs. At least 1, also where none are used.
  void resize(std::uint32_t photons);
  void create_pipelines(const vk::raii::PipelineLayout& layout, std::uint32_t features);
  // A pass, in this order: emission fills the queue of paths; a bounce after each extension works
  // on it; sorting makes the map. All sets and the push constants (GpuBatch: first_sample is the
  // pass, photon_radius) must be bound.
  void record_emission(const vk::raii::CommandBuffer& commands) const;
  void bind_bounce(const vk::raii::CommandBuffer& commands) const;
  void record_sorting(const vk::raii::CommandBuffer& commands) const;

 private:
  void write_set() const;
  static void dispatch(const vk::raii::CommandBuffer& commands, const Pipeline& pipeline,
                       std::uint32_t invocations);

  Device& device_;
  vk::raii::DescriptorSetLayout set_layout_{nullptr};
  vk::raii::DescriptorPool descriptors_{nullptr};
  vk::raii::DescriptorSet set_{nullptr};
  Pipeline emit_, bounce_, share_out_, scatter_, sort_;
  std::uint32_t photons_ = 0, bucket_count_ = 0;
  Buffer photon_buffer_, order_, filled_, control_, sorted_, buckets_;
};

}  // namespace previz::render
