// Where the light camera has to look for what lies in a direction from the set.
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>

#include "daemon/lighting/room.hpp"

namespace previz::lighting {

// Light from far away: the same direction from everywhere. Light from a room: the point of the room
// that is seen from Room::seen_from in that direction, as the camera sees it from where it stands;
// through the room's openings light is from far away again. Radiance is taken to leave a surface
// alike to both places.
class Viewpoint {
 public:
  // Orthogonal; it may mirror.
  explicit Viewpoint(const glm::dmat3& world_from_camera);
  // Rigid. `room` may be null: from far away.
  Viewpoint(const glm::dmat4& world_from_camera, std::shared_ptr<const Room> room);

  // The same looking the other way: across the plane perpendicular to the optical axis.
  Viewpoint mirrored() const;
  bool far_away() const { return !room_; }

  // In camera axes, of any length, from a unit world direction. Nothing where another part of the
  // room hides that point from the camera.
  std::optional<glm::dvec3> camera_direction(const glm::dvec3& world_direction) const;

 private:
  glm::dmat3 camera_from_world_;
  glm::dvec3 position_{0};
  std::shared_ptr<const Room> room_;
};

}  // namespace previz::lighting
