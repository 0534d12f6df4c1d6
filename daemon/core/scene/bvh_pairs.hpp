// Makes the leaves of a mesh's tree: triangles are joined in pairs along an edge where one box is
// no worse than two. It is internal to the scene room.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "daemon/core/scene/bvh_wide.hpp"

namespace previz::scene {

// A pair is the triangles (v0, v1, v2) and (v0, v2, v3); v3 = v2 where there is only the first. A
// triangle's vertices are its primitive's corners rotated left `rotation` times.
struct TrianglePair {
  std::array<glm::vec3, 4> vertices;
  std::array<std::uint32_t, 2> primitives{};
  std::array<std::uint32_t, 2> rotations{};
};

Aabb bounds_of(const TrianglePair& pair);

// Computes the bounds of the parts of the pair inside `bounds` on either side of the plane,
// slightly enlarged.
void split_pair(const TrianglePair& pair, const Aabb& bounds, int axis, float position, Aabb& left,
                Aabb& right);

// `corners` are the positions of triangles, `primitives` the triangles' indices in the mesh.
// Corners with equal numbers in `places` count as one; without `places`, those at the same
// position.
std::vector<TrianglePair> make_pairs(std::span<const std::array<glm::vec3, 3>> corners,
                                     std::span<const std::uint32_t> primitives,
                                     std::span<const std::array<std::uint32_t, 3>> places = {});

Record pair_record(const TrianglePair& pair);

}  // namespace previz::scene
