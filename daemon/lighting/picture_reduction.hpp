// Makes a picture coarser where a light map is much coarser than it is.
#pragma once

#include <algorithm>
#include <cmath>

#include "daemon/lighting/linear_picture.hpp"

namespace previz::lighting {

// Returns the picture with fewer pixels, each the mean of those that it covers, in whole or in
// part. weight(x, y) is the solid angle of a pixel of the fine picture, by any unit.
template <typename Weight>
LinearPicture reduced(const LinearPicture& fine, int width, int height, const Weight& weight) {
  LinearPicture coarse{width, height, {}};
  coarse.radiance.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  const double pixels_across = static_cast<double>(fine.width) / width;
  const double pixels_down = static_cast<double>(fine.height) / height;
  // The part of a fine pixel that lies between two places along an axis.
  const auto part = [](int pixel, double begin, double end) {
    return std::min(pixel + 1.0, end) - std::max(static_cast<double>(pixel), begin);
  };
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      const double left = column * pixels_across, right = left + pixels_across;
      const double top = row * pixels_down, bottom = top + pixels_down;
      glm::dvec3 sum(0);
      double all = 0;
      for (int y = static_cast<int>(top); y < std::min<double>(bottom, fine.height); ++y)
        for (int x = static_cast<int>(left); x < std::min<double>(right, fine.width); ++x) {
          const double share = weight(x, y) * part(x, left, right) * part(y, top, bottom);
          sum += share * glm::dvec3(fine.at(x, y));
          all += share;
        }
      coarse.radiance.emplace_back(sum / all);
    }
  return coarse;
}

}  // namespace previz::lighting
