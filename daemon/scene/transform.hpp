// What a transform read from a file must be checked for.
#pragma once

#include <cmath>
#include <glm/mat4x4.hpp>

namespace previz::scene {

inline bool is_finite(const glm::dmat4& transform) {
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 4; ++row)
      if (!std::isfinite(transform[column][row])) return false;
  return true;
}

}  // namespace previz::scene
