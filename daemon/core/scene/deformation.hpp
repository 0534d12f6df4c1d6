// How meshes change their shape while an animation plays: skins and morph targets (glTF 2.0, 3.7.2
// and 3.7.3), as data, and the shape of a mesh at a time.
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "daemon/core/scene/animation.hpp"

namespace previz::scene {

// A morph target: what is added to each vertex, times the target's weight. `normals` may be empty.
struct MorphTarget {
  std::vector<glm::vec3> positions, normals;
  friend bool operator==(const MorphTarget&, const MorphTarget&) = default;
};

// Up to four joints that a vertex follows. A vertex's weights are not negative, and their sum over
// all its influences is 1.
struct Influence {
  std::array<std::uint16_t, 4> joints{};
  glm::vec4 weights{0};
  friend bool operator==(const Influence&, const Influence&) = default;
};

// A mesh before any target or joint has moved it: first the targets are added, then the joints
// place the result. Arrays have one entry per vertex. A mesh that keeps its shape has none of this.
struct Undeformed {
  std::vector<glm::vec3> positions, normals;  // normals are unit
  bool flat = false;  // the file has no normals: vertices 3 i to 3 i + 2 take those of triangle i
  std::vector<MorphTarget> targets;
  std::uint32_t influences_per_vertex = 0;  // 0: there is no skin
  std::vector<Influence> influences;        // those of a vertex together
  bool is_empty() const { return targets.empty() && influences.empty(); }
  friend bool operator==(const Undeformed&, const Undeformed&) = default;
};

// The shape of one mesh: a weight for each morph target, and for each joint the transform that
// takes a vertex along, from the undeformed mesh to the instance's object space.
struct Shape {
  std::vector<double> weights;
  std::vector<glm::dmat4> joints;
  friend bool operator==(const Shape&, const Shape&) = default;
};

// Weights of morph targets that change over time. `values` has as many numbers a key as there are
// targets; with a cubic spline three times as many: in-tangents, values, out-tangents.
struct WeightChannel {
  Interpolation interpolation = Interpolation::linear;
  std::vector<double> times_s;  // increasing; empty: nothing changes
  std::vector<double> values;
};

// Returns the weights at a time, as vector_at() does. The channel must not be empty.
std::vector<double> weights_at(const WeightChannel& channel, std::size_t targets, double time_s);

// The largest coordinate of a mesh before it is deformed, and of what each target adds.
struct Extent {
  double vertices = 0;
  std::vector<double> targets;
  friend bool operator==(const Extent&, const Extent&) = default;
};

// A mesh whose shape is animated; one instance shows it. The object space of a skinned instance is
// that of the file, because its node's own transform has no effect (glTF 2.0, 3.7.3.3).
struct Deformation {
  struct Joint {
    glm::dmat4 joint_from_mesh{1.0};  // inverse bind matrix
    glm::dmat4 file_from_joint{1.0};  // at rest
    std::uint32_t node = no_node;     // of the object's animation; no_node: it stands still
    friend bool operator==(const Joint&, const Joint&) = default;
  };
  std::uint32_t mesh = 0, instance = 0;  // in the scene
  std::uint32_t object = 0;              // in the set
  std::vector<double> weights;           // of the morph targets at rest
  WeightChannel weight_channel;
  std::vector<Joint> joints;
  Extent extent;
};

// Returns the shape of the file as it is, with nothing played.
Shape shape_at_rest(const Deformation& deformation);
// Returns the shape at a time after the start of the object's animation. `world_from_nodes` are
// those of the animation at that time.
Shape shape_at(const Deformation& deformation, const Animation& animation,
               std::span<const glm::dmat4> world_from_nodes, double time_s);

// Returns the extent of a mesh's vertices and of its targets.
Extent extent_of(const Undeformed& mesh);
// Returns whether every number of the shape, and every vertex of a mesh of this extent in it, stays
// below 1e15, where nothing overflows in single precision. A shape that is not finite does not.
bool can_be_shown(const Shape& shape, const Extent& extent);

struct DeformedVertices {
  std::vector<glm::vec3> positions, normals;
};

// Returns the vertices of a mesh in this shape, computed in double precision. Every joint that an
// influence names must be in the shape.
DeformedVertices deformed(const Undeformed& mesh, const Shape& shape);

}  // namespace previz::scene
