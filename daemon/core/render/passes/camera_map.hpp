// This header uses the camera as a measurement: its map says which pixels of the plate show a
// single real surface, and how far away it is, so that paths may take the surface's radiance from
// them (shaders/README.md, "Camera radiance").
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "daemon/core/render/device/kernel.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

class CameraMap {
 public:
  // The map is empty before the first upload().
  explicit CameraMap(Device& device) : device_(device) { resize(1); }

  void create_kernels(std::uint32_t features);
  static std::span<const Pass> passes();  // of these kernels
  // Adds the map's buffers, for the passes that read the map and for record().
  void add_to(Buffers& buffers) const;
  // Makes room for a picture of so many pixels, of which each code stands for this radiance.
  void use(std::uint32_t pixels, const std::vector<float>& radiance_of_codes);
  // Makes the map. `parts` are whole rows that together make up the picture; `buffers` hold the
  // scene with the plate, and the map.
  void record(const vk::raii::CommandBuffer& commands, const std::vector<gpu::GpuBatch>& parts,
              const Buffers& buffers);

 private:
  void resize(std::uint32_t pixels);

  Device& device_;
  Kernel measured_, depth_, usable_;
  std::uint32_t pixels_ = 0;
  std::vector<float> radiance_;  // as in radiance_of_
  Buffer radiance_of_, plate_, seen_;
};

}  // namespace previz::render
