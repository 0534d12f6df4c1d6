// Builds a binary tree over boxes, one box per leaf, from which the wide tree is collapsed. It is
// internal to the scene room.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "daemon/core/scene/aabb.hpp"

namespace previz::scene {

struct BinaryNode {
  Aabb bounds;
  std::uint32_t left = 0, right = 0;  // 0: this is a leaf
  std::uint32_t primitive = 0;        // of a leaf
};

// Computes the bounds of the two parts of a primitive, clipped to `bounds`, on either side of a
// plane.
using SplitPrimitive = std::function<void(std::uint32_t primitive, const Aabb& bounds, int axis,
                                          float position, Aabb& left, Aabb& right)>;

// Returns the nodes in depth-first order, the root first. High quality may split primitives, which
// are then in several leaves. `boxes` must not be empty. Throws previz::Error if Embree fails.
std::vector<BinaryNode> build_binary_tree(std::span<const Aabb> boxes, BvhQuality quality,
                                          const SplitPrimitive& split);

// Builds a tree by median splits: it ignores cost but is as shallow as possible.
std::vector<BinaryNode> build_balanced_tree(std::span<const Aabb> boxes);

}  // namespace previz::scene
