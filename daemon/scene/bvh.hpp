// Two-level bounding volume hierarchy: Embree builds, we encode 8-wide quantised nodes for the GPU
// (CWBVH: Ylitie, Karras, Laine 2017). Objects move by rebuilding the small top level only.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include "daemon/scene/scene.hpp"

namespace previz::scene {

struct Aabb {
  glm::vec3 low{1e30f};
  glm::vec3 high{-1e30f};
};

// The bottom level of one mesh, position independent: child indices are relative to `nodes`.
struct MeshBvh {
  std::vector<glm::uvec4> nodes;        // 5 texels a node (80 bytes)
  std::vector<glm::vec4> triangles;     // 3 texels a triangle in leaf order; primitive in v0.w's bits
  Aabb bounds;                          // object space
  double sah_cost = 0;                  // relative to the root's area; guards against bad builds
  std::uint32_t dropped_triangles = 0;  // NaN or zero area: reported, never traced
};

enum class BvhQuality { low, medium, high };

MeshBvh build_mesh_bvh(const Mesh& mesh, BvhQuality quality = BvhQuality::medium);

// The top level over instances.
struct TopBvh {
  std::vector<glm::uvec4> nodes;          // same encoding; a leaf names instances
  std::vector<std::uint32_t> instances;   // leaf order -> index of Scene::instances
};

TopBvh build_top_bvh(std::span<const Aabb> instance_world_bounds);

// World bounds of an instance (conservative for any affine transform).
Aabb transform_bounds(const Aabb& object_bounds, const glm::dmat4& world_from_object);

}  // namespace previz::scene
