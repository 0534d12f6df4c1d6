// Represents the room that the light comes from as surfaces that rays can be sent to.
#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

namespace previz::lighting {

// Triangles are three corners each, world, metres; both sides count.
using Triangles = std::vector<glm::dvec3>;

// Returns the inside of a box of this size around its own origin.
Triangles box_triangles(const glm::dvec3& size_m, const glm::dmat4& world_from_box);

// Nothing is hidden by a surface that is as near to where it is seen from.
inline constexpr double on_surface_m = 1e-3;

// Returns the place, or, if it is within on_surface_m of a triangle, the place that far in front of
// it, on the side of `camera`, or upwards where the camera is on the surface, too: rays from a
// surface would meet that surface in every direction.
glm::dvec3 off_surfaces(const Triangles& triangles, glm::dvec3 place, const glm::dvec3& camera);

class Room {
 public:
  // Throws previz::Error if there is no triangle. Embree traces the triangles in metres relative
  // to `seen_from`.
  Room(const Triangles& triangles, const glm::dvec3& seen_from);
  ~Room();
  Room(Room&&) noexcept;
  Room& operator=(Room&&) noexcept;

  const glm::dvec3& seen_from() const { return seen_from_; }
  // Returns the distance along a unit direction to the nearest surface, 0 from a place on one;
  // nothing where the room is open.
  std::optional<double> distance(const glm::dvec3& origin, const glm::dvec3& direction) const;
  // Returns whether nothing stands between a place, which may lie on a surface itself, and a point
  // of a surface, to one part in a thousand.
  bool sees(const glm::dvec3& from, const glm::dvec3& surface_point) const;

 private:
  struct Impl;
  glm::dvec3 seen_from_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::lighting
