// Finds where rays from several cameras meet.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

namespace previz::tracking {

// A ray from a camera into the world, m; the direction has length 1.
struct Ray {
  glm::dvec3 origin{0}, direction{0, 0, 1};

  friend bool operator==(const Ray&, const Ray&) = default;
};

struct Meeting {
  glm::dvec3 at{0};         // with the least sum of squared distances from the rays
  double parallax_rad = 0;  // the largest angle between two of them
};

// Without parallax, `at` is the world's origin: nothing shows a distance.
Meeting meeting_of(const std::vector<Ray>& rays);

}  // namespace previz::tracking
