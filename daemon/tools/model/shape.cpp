#include "daemon/tools/model/shape.hpp"

#include <cmath>
#include <glm/geometric.hpp>

namespace previz::model {

glm::dvec3 corner(const Box& box, std::size_t index) {
  const double x = index % 4 == 1 || index % 4 == 2 ? 0.5 : -0.5, y = index % 4 < 2 ? -0.5 : 0.5;
  return box.foot + box.axes * (box.size * glm::dvec3(x, y, index < 4 ? 0 : 1));
}

Plane side_of(const Box& box, std::size_t axis, bool is_far) {
  const auto k = static_cast<glm::length_t>(axis);
  const double out = axis == 2 ? (is_far ? box.size.z : 0) : 0.5 * box.size[k];
  const glm::dvec3 normal = (is_far ? 1.0 : -1.0) * box.axes[k];
  return {box.foot + out * normal, normal};
}

glm::dvec3 rim_point(const Cylinder& cylinder, bool upper, const glm::dvec3& origin,
                     const glm::dvec3& direction) {
  const glm::dvec3 centre = cylinder.foot + (upper ? cylinder.height : 0.0) * cylinder.axis;
  const double along = glm::dot(direction, cylinder.axis);
  if (along == 0) return centre;
  const double t = glm::dot(centre - origin, cylinder.axis) / along;
  const glm::dvec3 off = origin + t * direction - centre;
  const double distance = glm::length(off);
  return distance > 0 ? centre + cylinder.radius / distance * off : centre;
}

std::array<glm::dvec3, 2> across(const glm::dvec3& axis) {
  const glm::dvec3 other = std::abs(axis.x) < 0.7 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 first = glm::normalize(other - glm::dot(other, axis) * axis);
  return {first, glm::cross(axis, first)};
}

glm::dmat3 upright_axes(const glm::dvec3& along, const glm::dvec3& up) {
  const glm::dvec3 flat = along - glm::dot(along, up) * up;
  const glm::dvec3 first = glm::length(flat) > 1e-9 ? glm::normalize(flat) : across(up)[0];
  return {first, glm::cross(up, first), up};
}

}  // namespace previz::model
