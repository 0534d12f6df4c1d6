// The camera as a measurement: which pixels of the plate show one real surface alone, and how far
// it is, so that paths may take that surface's radiance from them (estimator.md, "What makes it
// fast").
#pragma once

#include <cstdint>
#include <glm/vec4.hpp>
#include <vector>

#include "daemon/render/device.hpp"

namespace previz::render {

class CameraMap {
 public:
  // Pipeline layouts of the passes have this at set 3. Without a resize() the map is empty.
  explicit CameraMap(Device& device);
  const vk::raii::DescriptorSetLayout& set_layout() const { return set_layout_; }
  vk::DescriptorSet set() const { return *set_; }

  void resize(std::uint32_t pixels);
  void create_pipelines(const vk::raii::PipelineLayout& layout, std::uint32_t features);
  // Row-major, linear radiance; w: 1 where a pixel may be used, 0 where it is clipped.
  void upload(const std::vector<glm::vec4>& plate);
  // Makes the map from the plate uploaded. All sets must be bound.
  void record(const vk::raii::CommandBuffer& commands) const;

 private:
  Device& device_;
  vk::raii::DescriptorSetLayout set_layout_{nullptr};
  vk::raii::DescriptorPool descriptors_{nullptr};
  vk::raii::DescriptorSet set_{nullptr};
  Pipeline depth_, usable_;
  std::uint32_t pixels_ = 0;
  Buffer plate_, seen_;
};

}  // namespace previz::render
