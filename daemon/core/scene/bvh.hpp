// Builds the two-level bounding volume hierarchy for shaders/lib/trace.glsl: Embree builds binary
// trees, which we collapse to eight-wide quantised nodes after Ylitie, Karras, Laine, "Efficient
// Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs" (HPG 2017). Objects move by
// rebuilding the small top level (shaders/README.md, "Rays").
//
// Everything is a record of 64 bytes, four RGBA32UI texels (shaders/lib/shared.h): a node, a leaf
// of up to two triangles that share an edge, or an instance. The one buffer that the shader reads
// is the top level followed by the meshes. To build it:
//
//   1. Reserve the top: std::vector<glm::uvec4> texels(top_bvh_texels(instance_count)).
//   2. For each mesh: first_record = texels.size() / texels_per_record; append MeshBvh::texels.
//   3. Overwrite the front with build_top_bvh(...).texels, now and whenever an instance moves.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "daemon/core/scene/aabb.hpp"
#include "daemon/core/scene/scene.hpp"

namespace previz::scene {

inline constexpr std::uint32_t texels_per_record = 4;

// The bottom level of one mesh. It is position independent: indices inside it are relative to its
// start.
struct MeshBvh {
  std::vector<glm::uvec4> texels;  // whole records, in blocks of eight
  Aabb bounds;                     // object space; empty where the mesh has no triangle
  int grid_exponent = 0;           // the tree is in grid space = object space * 2^exponent
  double sah_cost = 0;             // expected records visited by a ray that meets the bounds
  std::uint32_t depth = 0;         // levels of nodes, at most gpu::MESH_BVH_DEPTH
  std::uint32_t leaves = 0;        // pairs and single triangles; split references count each
  // Triangles of zero area, with a bad index, or with a coordinate that is not finite or past 1e20.
  // They are never traced.
  std::uint32_t dropped_triangles = 0;
};

// The same input gives the same bytes. Throws previz::Error past 2^24 triangles.
MeshBvh build_mesh_bvh(const Mesh& mesh, BvhQuality quality = BvhQuality::medium);

// One instance of the top level; a hit identifies it by its index in the span given.
struct TopInstance {
  const MeshBvh* mesh = nullptr;
  std::uint32_t first_record = 0;       // where the mesh's records start in the whole buffer
  std::uint32_t presence = world_both;  // world_* bits; 0 is never hit
  glm::dmat4 world_from_object{1.0};    // any invertible affine transform
};

// Returns whether the instance can be traced: its transform is invertible and finite. Meshes
// without a triangle count too.
bool can_be_placed(const TopInstance& instance);

struct TopBvh {
  std::vector<glm::uvec4> texels;       // always top_bvh_texels(number of instances)
  std::uint32_t dropped_instances = 0;  // not invertible or not finite; empty meshes do not count
};

// Returns how many texels the top level over this many instances takes, wherever they are.
std::size_t top_bvh_texels(std::size_t instance_count);
// Throws previz::Error above 16,777,215 instances.
TopBvh build_top_bvh(std::span<const TopInstance> instances);

// Returns the triangles of the mesh that build_mesh_bvh() does not drop, by their numbers. Those of
// a mesh that deforms may become any.
std::vector<std::uint32_t> traced_triangles(const Mesh& mesh, bool deforms);

// Throws previz::Error if the mesh has more than 2^24 triangles.
void check_triangles(const Mesh& mesh);

// Returns the exponent of the grid of a tree with these bounds: MeshBvh::grid_exponent.
int grid_exponent_of(const Aabb& bounds);

// Returns the world bounds of an instance (conservative for any affine transform).
Aabb transform_bounds(const Aabb& object_bounds, const glm::dmat4& world_from_object);

}  // namespace previz::scene
