// Collapses a binary tree to the eight-wide tree of least cost and encodes it. It is internal to
// the scene room.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "daemon/core/scene/bvh_binary.hpp"

namespace previz::scene {

// A record is four texels as sixteen words; the layout is in shaders/lib/shared.h.
using Record = std::array<std::uint32_t, 16>;

struct WideTree {
  std::vector<Record> records;  // blocks of eight, the root first
  double sah_cost = 0;          // expected records visited by a ray that meets the root
  std::uint32_t depth = 0;      // levels of nodes
  std::uint32_t leaves = 0;
};

// `leaf` returns a primitive's record. The binary tree must be in grid space: integers of at most
// 2^23.
WideTree make_wide_tree(std::span<const BinaryNode> binary,
                        const std::function<Record(std::uint32_t primitive)>& leaf);

// Returns the wide tree of the chosen quality, or the balanced one if that would be too deep for
// the traversal's stack. Throws previz::Error where that is too deep as well.
WideTree make_tree(std::span<const Aabb> boxes, BvhQuality quality, const SplitPrimitive& split,
                   const std::function<Record(std::uint32_t primitive)>& leaf,
                   std::uint32_t most_levels);

// Returns a word of a record that is no node, with a harmless exponent (shaders/lib/shared.h).
std::uint32_t with_fill(std::uint32_t value, std::uint32_t rotation = 0);

// Returns an exponent e such that coordinates of at most `extent`, times 2^e, stay below 2^23.
int grid_exponent(double extent);

void append_texels(std::vector<glm::uvec4>& texels, std::span<const Record> records);

}  // namespace previz::scene
