// Holds what a set says about the real scene, as edges and as a surface that hides them.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/fit/feature_edges.hpp"
#include "daemon/core/lighting/room.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::fit {

// Returns whether neither a carrier nor an animation moves an instance.
bool stands_still(const scene::Instance& instance, const set::Set& set);

// Appends the triangles of an instance, in the world.
void append(const scene::Scene& scene, const scene::Instance& instance,
            lighting::Triangles& triangles);

struct ModelEdge {
  glm::dvec3 a{0}, b{0};  // world, metres
  // Something of the model touches it: a shadow begins there, which moves the edge of light by half
  // a pixel and more.
  bool is_touched = false;
  std::size_t part = no_part;  // in RealModel::parts()
};

// The parts of a scene that exist in the real world and stand still: phantoms and removed objects
// that no carrier and no animation moves. What is cut out by alpha, or lets light through, hides
// edges but has none.
class RealModel {
 public:
  // `scene` is load_scene(set); it is not kept.
  RealModel(const scene::Scene& scene, const set::Set& set);

  // These are the edges of feature_edges().
  const std::vector<ModelEdge>& edges() const { return edges_; }

  // Returns the names of the parts that the model consists of: the nodes of the files, or the
  // object itself where its file has one node, or where a node has no name. Every copy of a node is
  // a part. Names that would be alike begin with the object's, as "crates: lid", or end with a
  // number, as "chair (2 of 5)". Printed tags, and what is under them, are no parts.
  const std::vector<std::string>& parts() const { return parts_; }

  // Returns whether the model does not hide a point of an edge from an eye, to one part in a
  // thousand of the distance.
  bool is_seen(const glm::dvec3& eye, const glm::dvec3& point) const;

 private:
  std::optional<lighting::Room> surface_;  // absent: nothing is real
  std::vector<ModelEdge> edges_;
  std::vector<std::string> parts_;
};

}  // namespace previz::fit
