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

class Room {
 public:
  // Throws previz::Error if there is no triangle. Embree traces the triangles in metres relative
  // to `seen_from`.
  Room(const Triangles& triangles, const glm::dvec3& seen_from);
  ~Room();
  Room(Room&&) noexcept;
  Room& operator=(Room&&) noexcept;

  const glm::dvec3& seen_from() const { return seen_from_; }
  // Returns the distance along a unit direction to the nearest surface; nothing where the room is
  // open.
  std::optional<double> distance(const glm::dvec3& origin, const glm::dvec3& direction) const;
  // Returns whether nothing stands between a place and a point of a surface, to one part in a
  // thousand.
  bool sees(const glm::dvec3& from, const glm::dvec3& surface_point) const;

 private:
  struct Impl;
  glm::dvec3 seen_from_;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::lighting
