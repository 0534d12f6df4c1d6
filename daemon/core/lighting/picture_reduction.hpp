// Makes a picture coarser where a light map is much coarser than it is.
#pragma once

#include <glm/vec4.hpp>
#include <span>

#include "daemon/core/lighting/linear_picture.hpp"
#include "drivers/convert/area_average.hpp"

namespace previz::lighting {

// Returns the picture with fewer pixels, each the mean of those that it covers, in whole or in
// part. weight(x, y) is the solid angle of a pixel of the fine picture, by any unit; neither side
// of it is shorter than the coarse one's.
template <typename Weight>
LinearPicture reduced(const LinearPicture& fine, int width, int height, const Weight& weight) {
  LinearPicture coarse{width, height, {}};
  coarse.radiance.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  convert::AreaAverage<glm::dvec4> average(fine.width, fine.height, width, height);
  for (int y = 0; y < fine.height; ++y) {
    const auto weighted = [&](int x) {
      const double all = weight(x, y);
      return glm::dvec4(all * glm::dvec3(fine.at(x, y)), all);
    };
    average.add(weighted, [&](std::span<const glm::dvec4> sums) {
      for (const glm::dvec4& sum : sums) coarse.radiance.emplace_back(glm::dvec3(sum) / sum.w);
    });
  }
  return coarse;
}

}  // namespace previz::lighting
