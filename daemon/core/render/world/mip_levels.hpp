// Averages of a texture over ever larger areas (Williams 1983, "Pyramidal Parametrics").
#pragma once

#include <cstdint>
#include <vector>

#include "daemon/core/scene/scene.hpp"

namespace previz::render {

// A level has half as many texels a side as the one before, rounded down, and at least one.
struct MipLevel {
  int width = 0, height = 0;
  std::vector<glm::vec4> texels;  // row-major
};

// Returns the levels beyond the texture itself, the last of them one texel; none for a texture that
// is read at its nearest texel. A texel is the mean over the area that it covers, in linear light,
// so that every level has the mean of the texture.
std::vector<MipLevel> mip_levels(const scene::Texture& texture);

}  // namespace previz::render
