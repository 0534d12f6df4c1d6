// Encodes the environment map in the layout that the shaders read (shaders/README.md, "Light").
#pragma once

#include <cstdint>
#include <glm/vec4.hpp>
#include <vector>

#include "daemon/core/lighting/environment.hpp"

namespace previz::render {

// A default-constructed environment is black.
struct EncodedEnvironment {
  std::uint32_t size = 1;
  std::uint32_t levels = 0;  // log2(size)
  // (size + 2)^2, border wrapped by the octahedral rule; alpha: density of samples per steradian
  std::vector<glm::vec4> radiance = std::vector<glm::vec4>(9);
  std::vector<glm::vec4> importance;  // densities, level by level; see render_shared.h
  double mean = 0;                    // mean of (r + g + b) / 3 over the sphere
  // The solid angle that the light comes from, over 2 pi: the exponential of the entropy of its
  // distribution over directions. It is 2 for an even sphere, and a lamp's disc where all light
  // comes from that lamp.
  double spread = 2;
};

// Throws previz::Error if the size is not a power of two up to 4096 or a texel is negative or not
// finite (the lighting room never makes such a map).
EncodedEnvironment encode_environment(const lighting::EnvironmentMap& map);

}  // namespace previz::render
