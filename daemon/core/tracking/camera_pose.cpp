#include "daemon/core/tracking/camera_pose.hpp"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>

namespace previz::tracking {

glm::dmat3 rotation_by(const glm::dvec3& turn) {
  const double angle = glm::length(turn);
  return angle > 0 ? glm::mat3_cast(glm::angleAxis(angle, turn / angle)) : glm::dmat3(1.0);
}

glm::dmat3 orthonormal(const glm::dmat3& rotation) {
  return glm::mat3_cast(glm::normalize(glm::quat_cast(rotation)));
}

glm::dmat4 world_from_camera(const CameraFromWorld& pose) {
  const glm::dmat3 r = glm::transpose(pose.rotation);
  glm::dmat4 m(r);
  m[3] = glm::dvec4(-(r * pose.translation), 1);
  return m;
}

CameraFromWorld camera_from_world(const glm::dmat4& world_from_camera) {
  const glm::dmat3 r = glm::transpose(glm::dmat3(world_from_camera));
  return {r, -(r * glm::dvec3(world_from_camera[3]))};
}

double rotation_between(const CameraFromWorld& a, const CameraFromWorld& b) {
  // The angle follows from the difference's Frobenius norm, which is accurate for small angles,
  // where acos of the trace is not.
  const glm::dmat3 d = a.rotation - b.rotation;
  const double norm2 = glm::dot(d[0], d[0]) + glm::dot(d[1], d[1]) + glm::dot(d[2], d[2]);
  return 2 * std::asin(std::min(1.0, std::sqrt(norm2 / 8)));
}

}  // namespace previz::tracking
