#include "daemon/tracking/rays.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

namespace previz::tracking {

Meeting meeting_of(const std::vector<Ray>& rays) {
  glm::dmat3 normal(0);
  glm::dvec3 right(0);
  Meeting meeting;
  for (const Ray& ray : rays) {
    const glm::dmat3 across = glm::dmat3(1) - glm::outerProduct(ray.direction, ray.direction);
    normal += across;
    right += across * ray.origin;
    for (const Ray& other : rays)
      meeting.parallax_rad = std::max(
          meeting.parallax_rad,
          std::asin(std::min(1.0, glm::length(glm::cross(ray.direction, other.direction)))));
  }
  if (meeting.parallax_rad > 0) meeting.at = glm::inverse(normal) * right;
  return meeting;
}

}  // namespace previz::tracking
