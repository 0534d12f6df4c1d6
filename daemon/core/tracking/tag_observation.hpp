// A tag whose place is known, as it was found in a picture.
#pragma once

#include <array>
#include <glm/mat4x4.hpp>

#include "daemon/core/tracking/corners.hpp"

namespace previz::tracking {

struct TagObservation {
  int id = 0;
  double size_m = 0;
  glm::dmat4 world_from_tag{1.0};
  CornerPixels corners{};
  std::array<double, 64> covariance{};  // px^2, from the picture
};

}  // namespace previz::tracking
