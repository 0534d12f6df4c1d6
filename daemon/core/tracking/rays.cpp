#include "daemon/core/tracking/rays.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "drivers/calibration/pinhole.hpp"

namespace previz::tracking {
namespace {

double angle_between(const glm::dvec3& a, const glm::dvec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

}  // namespace

std::optional<Ray> ray_through(const PinholeIntrinsics& lens, const glm::dmat4& world_from_camera,
                               const glm::dvec2& px) {
  const auto at = undistort(lens, px);
  if (!at) return std::nullopt;
  return Ray{glm::dvec3(world_from_camera[3]),
             glm::normalize(glm::dmat3(world_from_camera) * glm::dvec3(*at, 1))};
}

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
  if (!(meeting.parallax_rad > 0)) return meeting;
  meeting.at = glm::inverse(normal) * right;
  for (const Ray& ray : rays)
    meeting.off_rad =
        std::max(meeting.off_rad, angle_between(ray.direction, meeting.at - ray.origin));
  return meeting;
}

bool fit_a_rectangle(const std::array<glm::dvec3, 3>& corners) {
  constexpr double most_off_rad = 25 * std::numbers::pi / 180;
  const double angle = angle_between(corners[0] - corners[1], corners[2] - corners[1]);
  return std::abs(angle - 0.5 * std::numbers::pi) < most_off_rad;
}

}  // namespace previz::tracking
