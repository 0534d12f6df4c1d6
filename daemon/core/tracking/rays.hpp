// Finds where rays from several cameras meet.
#pragma once

#include <array>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "drivers/calibration.hpp"

namespace previz::tracking {

// A ray from a camera into the world, m; the direction has length 1.
struct Ray {
  glm::dvec3 origin{0}, direction{0, 0, 1};

  friend bool operator==(const Ray&, const Ray&) = default;
};

struct Meeting {
  glm::dvec3 at{0};         // with the least sum of squared distances from the rays
  double parallax_rad = 0;  // the largest angle between two of them
  // The largest angle between a ray and the way from its origin to `at`: more than half pi if that
  // is behind a camera.
  double off_rad = 0;
};

// Returns the ray of a pixel of a camera; nothing if the lens shows nothing there.
std::optional<Ray> ray_through(const PinholeIntrinsics& lens, const glm::dmat4& world_from_camera,
                               const glm::dvec2& px);

// Without parallax, `at` is the world's origin: nothing shows a distance.
Meeting meeting_of(const std::vector<Ray>& rays);

// Returns whether three corners of a rectangle are in order around: the angle at the second is a
// right one within 25 degrees, which leaves room for marks; at the wrong corner of a square it is
// off by 45.
bool fit_a_rectangle(const std::array<glm::dvec3, 3>& corners);

}  // namespace previz::tracking
