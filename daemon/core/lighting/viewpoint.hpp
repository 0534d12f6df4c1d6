// Finds the direction in which the light camera sees the light that reaches the set from a given
// direction.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>

#include "daemon/core/lighting/room.hpp"

namespace previz::lighting {

// Light from far away has the same direction everywhere. With a room, the light of a direction
// comes from the point of the room that is seen from Room::seen_from in that direction, and the
// camera sees that point from where it stands; through the room's openings light comes from far
// away again. A surface is assumed to send the same radiance to both places.
class Viewpoint {
 public:
  // The matrix must be orthogonal; it may mirror.
  explicit Viewpoint(const glm::dmat3& world_from_camera);
  // The pose must be rigid. `room` may be null: all light is from far away.
  Viewpoint(const glm::dmat4& world_from_camera, std::shared_ptr<const Room> room);

  // Returns the viewpoint mirrored across the plane perpendicular to the optical axis.
  Viewpoint mirrored() const;
  bool far_away() const { return !room_; }

  // Returns the direction in camera axes, of any length, for a unit world direction. Returns
  // nothing where another part of the room hides that point from the camera.
  std::optional<glm::dvec3> camera_direction(const glm::dvec3& world_direction) const;

 private:
  glm::dmat3 camera_from_world_;
  glm::dvec3 position_{0};
  std::shared_ptr<const Room> room_;
};

}  // namespace previz::lighting
