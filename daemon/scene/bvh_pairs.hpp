// The leaves of a mesh's tree: triangles joined by twos along an edge, where that makes one box no
// worse than two. Internal to the scene room.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "daemon/scene/bvh.hpp"

namespace previz::scene {

// Triangles (v0, v1, v2) and (v0, v2, v3); v3 = v2 where there is only the first. A triangle's
// vertices are its primitive's corners turned left `rotation` times.
struct TrianglePair {
  std::array<glm::vec3, 4> vertices;
  std::array<std::uint32_t, 2> primitives{};
  std::array<std::uint32_t, 2> rotations{};
};

Aabb bounds_of(const TrianglePair& pair);

// Bounds of the parts of the pair inside `bounds` on either side of the plane, slightly enlarged.
void split_pair(const TrianglePair& pair, const Aabb& bounds, int axis, float position, Aabb& left,
                Aabb& right);

// `corners` are positions, `primitives` their index in the mesh; vertices at one place are one.
std::vector<TrianglePair> make_pairs(std::span<const std::array<glm::vec3, 3>> corners,
                                     std::span<const std::uint32_t> primitives);

}  // namespace previz::scene
