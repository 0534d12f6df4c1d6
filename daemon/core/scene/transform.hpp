// Checks transforms that were read from a file.
#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>

namespace previz::scene {

inline bool is_finite(const glm::dmat4& transform) {
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 4; ++row)
      if (!std::isfinite(transform[column][row])) return false;
  return true;
}

inline bool is_invertible(const glm::dmat4& transform) {
  const glm::dmat3 linear(transform);
  const double size = glm::length(linear[0]) * glm::length(linear[1]) * glm::length(linear[2]);
  return is_finite(transform) && std::isfinite(size) && size > 0 &&
         std::abs(glm::determinant(linear)) > 1e-12 * size;
}

}  // namespace previz::scene
