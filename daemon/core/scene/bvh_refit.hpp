// Trees of meshes that deform. Their leaves are chosen once; the boxes above them follow the
// vertices on the GPU (shaders/refit_leaves.comp, shaders/refit_nodes.comp), and now and then a
// better tree is built above the same leaves. What a ray hits depends on the leaves alone, so a
// picture does not depend on when that happened.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "daemon/core/scene/bvh.hpp"
#include "daemon/core/scene/scene.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::scene {

// A pair of triangles by the vertices of the mesh (shaders/lib/shared.h, "pair").
struct DeformingPair {
  glm::uvec4 vertices{0};
  glm::uvec2 primitives{0}, rotations{0};
};

// Joins the triangles of a mesh to pairs, in the shape that it has now. Vertices count as one only
// if they stay together in every shape. Triangles with a bad index are left out. Throws
// previz::Error past 2^24 triangles.
std::vector<DeformingPair> deforming_pairs(const Mesh& mesh);

// The steps by which a tree follows its vertices.
struct RefitPlan {
  std::vector<gpu::GpuRefitLeaf> leaves;
  std::vector<std::uint32_t> nodes;   // records of the nodes, the deepest level first
  std::vector<std::uint32_t> levels;  // number of nodes of each level, the deepest first
};

struct RefittableBvh {
  MeshBvh bvh;
  RefitPlan plan;
};

// Builds a tree above the pairs for these positions.
RefittableBvh build_refittable_bvh(std::span<const DeformingPair> pairs,
                                   std::span<const glm::vec3> positions);

// Where the vertices of a mesh are before it is deformed, by joint and by morph target: enough to
// bound the mesh in any shape without looking at its vertices.
struct DeformationReach {
  Aabb whole;                      // of all vertices, without a skin
  std::vector<Aabb> joints;        // of the vertices that follow each; empty where none does
  std::vector<glm::vec3> targets;  // largest offset of each, per axis
};
DeformationReach reach_of(const Mesh& mesh, std::size_t joints);

// Returns bounds that contain the mesh in this shape, in the instance's object space: a vertex is a
// mean of where its joints take it.
Aabb deformed_bounds(const DeformationReach& reach, const Shape& shape);

// Returns a bound on how far a point of the mesh moves from one shape to another, in units of the
// instance's object space.
double most_moved(const DeformationReach& reach, const Shape& before, const Shape& after);

}  // namespace previz::scene
