// Checks geometry that a set file gives by hand: transforms, and tags measured by their corners.
#pragma once

#include <array>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <optional>

#include "drivers/calibration/pose.hpp"

namespace previz::set {

// Largest distance of a measured tag corner from the square fitted to all four, as a fraction of
// the side.
inline constexpr double square_tolerance = 0.02;

// Returns |det| divided by the product of the column lengths: 1 for orthogonal axes, 0 for a
// singular matrix.
double regularity(const glm::dmat4& transform);

struct FittedSquare {
  glm::dmat4 world_from_tag;
  double size;   // side length, in the unit of the corners
  double error;  // largest distance of a corner from the square, as a fraction of the side
};
// Fits a square to four corners, given as lower left, lower right, upper right, upper left. Returns
// nothing if the corners enclose no area.
std::optional<FittedSquare> fit_square(const std::array<glm::dvec3, 4>& corners);

}  // namespace previz::set
