// The camera as a measurement. The map says which pixels of the plate show a single real surface,
// and how far away it is, so that paths may take the surface's radiance from them
// (shaders/README.md, "Camera radiance").
#pragma once

#include <cstdint>
#include <glm/vec4.hpp>
#include <vector>

#include "daemon/render/kernel.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

class CameraMap {
 public:
  // The map is empty before the first upload().
  explicit CameraMap(Device& device) : device_(device) { resize(1); }

  void create_kernels(std::uint32_t features);
  // The map, for the passes that read it and those below.
  void add_to(Buffers& buffers) const;
  // Row-major, linear radiance; w: 1 where a pixel may be used, 0 where it is clipped.
  void upload(const std::vector<glm::vec4>& plate);
  // Makes the map from the plate uploaded. `parts`: whole rows, which make up the picture;
  // `buffers`: the scene's and the map's.
  void record(const vk::raii::CommandBuffer& commands, const std::vector<gpu::GpuBatch>& parts,
              const Buffers& buffers);

 private:
  void resize(std::uint32_t pixels);

  Device& device_;
  Kernel depth_, usable_;
  std::uint32_t pixels_ = 0;
  Buffer plate_, seen_;
};

}  // namespace previz::render
