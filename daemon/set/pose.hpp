// Geometry that a set file gives by hand: poses, tags measured by their corners, lens polynomials.
#pragma once

#include <array>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <optional>

#include "drivers/calibration.hpp"

namespace previz::set {

// Largest |entry| of R^T R - 1 that still passes as a rotation; poses are typed with 6 digits.
inline constexpr double rigid_tolerance = 1e-4;
// Largest distance of a measured tag corner from the square fitted to all four, over its side.
inline constexpr double square_tolerance = 0.02;

// Turns about world X by angles.x, then Y, then Z (radians; Rz Ry Rx, Blender's "XYZ Euler"), then
// moves to `position`.
glm::dmat4 pose(const glm::dvec3& position, const glm::dvec3& angles_rad);

// How far the upper 3x3 is from a rotation: the largest |entry| of R^T R - 1; infinite where it
// mirrors.
double rigidity_error(const glm::dmat4& transform);

// `transform` with its upper 3x3 replaced by the nearest rotation (polar decomposition by Newton's
// iteration, Higham 1986). The upper 3x3 must be regular.
glm::dmat4 nearest_rigid(const glm::dmat4& transform);

// |det| over the product of the column lengths: 1 for orthogonal axes, 0 for singular ones.
double regularity(const glm::dmat4& transform);

struct FittedSquare {
  glm::dmat4 world_from_tag;
  double size;   // of a side, in the unit of the corners
  double error;  // largest distance of a corner from the square, over the side
};
// Corners: lower left, lower right, upper right, upper left. Nothing where they have no area.
std::optional<FittedSquare> fit_square(const std::array<glm::dvec3, 4>& corners);

// The first angle in (0, max_angle_rad] where the fisheye's radius stops growing, if there is one.
std::optional<double> fold_angle(const FisheyeIntrinsics& intrinsics);

}  // namespace previz::set
