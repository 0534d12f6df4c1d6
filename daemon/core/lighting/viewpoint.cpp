#include "daemon/core/lighting/viewpoint.hpp"

#include <glm/matrix.hpp>
#include <utility>

namespace previz::lighting {

Viewpoint::Viewpoint(const glm::dmat3& world_from_camera)
    : camera_from_world_(glm::transpose(world_from_camera)) {}

Viewpoint::Viewpoint(const glm::dmat4& world_from_camera, std::shared_ptr<const Room> room)
    : camera_from_world_(glm::transpose(glm::dmat3(world_from_camera))),
      position_(world_from_camera[3]),
      room_(std::move(room)) {}

Viewpoint Viewpoint::mirrored() const {
  Viewpoint other = *this;
  other.camera_from_world_ = glm::dmat3(1, 0, 0, 0, 1, 0, 0, 0, -1) * camera_from_world_;
  return other;
}

std::optional<glm::dvec3> Viewpoint::camera_direction(const glm::dvec3& world_direction) const {
  if (!room_) return camera_from_world_ * world_direction;
  const auto distance = room_->distance(room_->seen_from(), world_direction);
  if (!distance) return camera_from_world_ * world_direction;
  const glm::dvec3 point = room_->seen_from() + *distance * world_direction;
  if (!room_->sees(position_, point)) return std::nullopt;
  return camera_from_world_ * (point - position_);
}

}  // namespace previz::lighting
