// The renderer's result for one frame: the composite and everything it was made of.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>

#include "daemon/core/render/picture/scratch.hpp"

namespace previz::render {

// All arrays are row-major, width * height; radiance is linear Rec. 709 in the set's units.
struct Layers {
  Layers() = default;
  explicit Layers(const std::shared_ptr<Scratch>& scratch)
      : composite(scratch),
        mixed(scratch),
        real(scratch),
        diff(scratch),
        normal(scratch),
        variance(scratch),
        mask(scratch),
        depth(scratch) {}

  int width = 0;
  int height = 0;
  bool denoised = false;     // the composite was denoised; `variance` estimates the noise left
  std::int64_t samples = 0;  // per pixel; the largest number, where it differs
  double white = std::numeric_limits<double>::infinity();  // radiance at which the sensor clips
  Sheet<glm::vec3> composite;  // by the set's rule: daemon/core/render/picture/composite.hpp
  Sheet<glm::vec3> mixed;      // mean(Lm)
  Sheet<glm::vec3> real;       // mean(Lr); Lc where only the difference was traced
  Sheet<glm::vec3> diff;       // mean(Lm - Lr), accumulated as a difference
  Sheet<glm::vec3> normal;     // mean world normal of the mixed world's first hit
  Sheet<glm::vec3> variance;   // of the composite
  Sheet<float> mask;           // mean(M), 0..1
  Sheet<float> depth;          // metres along the optical axis, mean over hits; 0: no hit
};

// Events counted on the GPU, never silently discarded. The tests demand zero drops.
struct Counters {
  std::uint64_t rays = 0;  // path segments traced
  std::uint64_t shadow_rays = 0;
  std::uint64_t dropped_not_finite = 0;  // NaN or Inf samples
  std::uint64_t dropped_negative = 0;
  std::uint64_t stopped_in_layers = 0;  // rays through too many transparent surfaces
  std::uint64_t unfinished = 0;         // paths that were cut off with their batch; always 0
  // Pixels of the shown picture in which a shadow would have taken more light than the plate has:
  // the model's real world is brighter there than the picture.
  std::uint64_t below_zero = 0;
  // With real_radiance = "camera": real surfaces whose radiance came from the plate, and real
  // surfaces that had to be traced.
  std::uint64_t measured = 0;
  std::uint64_t unmeasured = 0;
  // Trees of meshes that deform that were built anew since the frame before was begun.
  std::uint64_t rebuilt_trees = 0;
  // Counts how often the lamps and emissive triangles were encoded: once, and whenever one has
  // changed.
  std::uint64_t encoded_lights = 0;
  // Since the renderer was made: trees of meshes that were built as scenes were set, and how often
  // all materials, and all textures, were uploaded.
  std::uint64_t built_trees = 0, uploaded_materials = 0, uploaded_textures = 0;
};

}  // namespace previz::render
