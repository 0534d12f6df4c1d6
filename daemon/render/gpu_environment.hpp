// The environment map in the layout the shaders read.
#pragma once

#include <cstdint>
#include <glm/vec4.hpp>
#include <vector>

#include "daemon/lighting/environment.hpp"

namespace previz::render {

// Black until it is made.
struct EncodedEnvironment {
  std::uint32_t size = 1;
  std::uint32_t levels = 0;  // log2(size)
  // (size + 2)^2, border wrapped by the octahedral rule
  std::vector<glm::vec4> radiance = std::vector<glm::vec4>(9);
  std::vector<glm::vec4> importance;  // densities, level by level; see render_shared.h
  double mean = 0;                    // mean of (r + g + b) / 3 over the sphere
  // Solid angle over 2 pi that its light comes from, the exponential of the entropy of where: 2 for
  // an even sphere, a lamp's disc where all comes from that.
  double spread = 2;
};

// Throws previz::Error if the size is not a power of two up to 4096 or a texel is negative or not
// finite (the lighting room never makes such a map).
EncodedEnvironment encode_environment(const lighting::EnvironmentMap& map);

}  // namespace previz::render
