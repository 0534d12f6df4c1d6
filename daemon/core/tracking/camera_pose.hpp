// A pose of the camera, and its rotation.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

namespace previz::tracking {

// A point is transformed by x_camera = rotation * x_world + translation (m).
struct CameraFromWorld {
  glm::dmat3 rotation{1.0};
  glm::dvec3 translation{0};
};

// Returns the rotation by |turn| rad about the axis `turn`.
glm::dmat3 rotation_by(const glm::dvec3& turn);

// Returns the rotation without the rounding errors of many products.
glm::dmat3 orthonormal(const glm::dmat3& rotation);

glm::dmat4 world_from_camera(const CameraFromWorld& pose);
CameraFromWorld camera_from_world(const glm::dmat4& world_from_camera);
// Returns the angle of the rotation between two poses, rad.
double rotation_between(const CameraFromWorld& a, const CameraFromWorld& b);

}  // namespace previz::tracking
