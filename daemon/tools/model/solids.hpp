// Makes closed geometry of a shape: what stands on a plane ends there, and planes end where they
// meet.
#pragma once

#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "daemon/tools/model/scan_mesh.hpp"
#include "daemon/tools/model/start.hpp"

namespace previz::model {

// A flat, convex face; its corners are counter-clockwise seen from outside.
struct Face {
  std::string name;  // "top", "side 1-2"
  std::vector<glm::dvec3> outline;
};

struct Solid {
  std::string name;
  std::vector<Face> faces;
};

glm::dvec3 normal_of(const Face& face);

// Returns whether a point of a face's plane is within its outline.
bool is_in(const Face& face, const glm::dvec3& point);

// Returns the triangles of all faces; faces share no corners, so that the normals are theirs.
NamedMesh mesh_of(const Solid& solid);

// Returns whether a face lies between an eye and a point, and not just at the point.
bool is_hidden(const std::vector<Solid>& solids, const glm::dvec3& eye, const glm::dvec3& point);

// Returns a solid for each plane that belongs to no room, each box, cylinder and room, in this
// order. The shape must be settled. With the pictures, a wall goes up to where their upper edges
// show it, and its margin beyond, unless an outline or a height says where it ends. Throws
// previz::Error naming a plane whose outline is not convex, or of which the planes that stand on it
// leave nothing.
std::vector<Solid> solids_of(const Parts& parts, const Layout& layout, const Shape& shape,
                             const Views* views = nullptr);

}  // namespace previz::model
