#include "daemon/core/scene/bvh_refit.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <map>
#include <numeric>
#include <utility>

#include "daemon/core/scene/bvh_pairs.hpp"
#include "daemon/core/scene/bvh_wide.hpp"
#include "drivers/error.hpp"
#include "shaders/lib/shared.h"

namespace previz::scene {
namespace {

constexpr std::size_t block_records = 8;

// Compares vertices by everything that moves them.
class MovesAlike {
 public:
  explicit MovesAlike(const Undeformed& mesh) : mesh_(mesh) {}

  // Returns below, at or above 0 for an order in which vertices that move alike are equal.
  int compare(std::uint32_t a, std::uint32_t b) const {
    if (const int order = of(mesh_.positions[a], mesh_.positions[b])) return order;
    for (const MorphTarget& target : mesh_.targets)
      if (const int order = of(target.positions[a], target.positions[b])) return order;
    for (std::uint32_t i = 0; i < mesh_.influences_per_vertex; ++i) {
      const Influence& of_a = mesh_.influences[a * mesh_.influences_per_vertex + i];
      const Influence& of_b = mesh_.influences[b * mesh_.influences_per_vertex + i];
      for (int k = 0; k < 4; ++k) {
        const auto at = static_cast<std::size_t>(k);
        if (of_a.joints[at] != of_b.joints[at]) return of_a.joints[at] < of_b.joints[at] ? -1 : 1;
        if (of_a.weights[k] != of_b.weights[k]) return of_a.weights[k] < of_b.weights[k] ? -1 : 1;
      }
    }
    return 0;
  }

 private:
  static int of(const glm::vec3& a, const glm::vec3& b) {
    for (int i = 0; i < 3; ++i)
      if (a[i] != b[i]) return a[i] < b[i] ? -1 : 1;
    return 0;
  }
  const Undeformed& mesh_;
};

// Returns for each vertex the first of those that move alike with it.
std::vector<std::uint32_t> first_alike(const Undeformed& mesh) {
  std::vector<std::uint32_t> order(mesh.positions.size()), first(order.size());
  std::iota(order.begin(), order.end(), 0u);
  const MovesAlike alike(mesh);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const int compared = alike.compare(a, b);
    return compared != 0 ? compared < 0 : a < b;
  });
  for (std::size_t i = 0; i < order.size(); ++i) {
    const bool is_new = i == 0 || alike.compare(order[i - 1], order[i]) != 0;
    first[order[i]] = is_new ? order[i] : first[order[i - 1]];
  }
  return first;
}

// Collects the nodes of a tree by their level, and finds the leaves' pairs again.
class Planner {
 public:
  Planner(std::span<const Record> records, std::span<const DeformingPair> pairs)
      : records_(records) {
    for (const DeformingPair& pair : pairs) by_primitive_[pair.primitives.x] = &pair;
  }

  RefitPlan plan() {
    visit(0, 0);
    RefitPlan plan{std::move(leaves_), {}, {}};
    for (auto level = levels_.rbegin(); level != levels_.rend(); ++level) {
      plan.nodes.insert(plan.nodes.end(), level->begin(), level->end());
      plan.levels.push_back(static_cast<std::uint32_t>(level->size()));
    }
    return plan;
  }

 private:
  void visit(std::uint32_t record, std::size_t level) {
    const Record& words = records_[record];
    const std::uint32_t kind = words[2] & 0xffu;
    if (kind == gpu::RECORD_NOTHING) return;
    if (kind == gpu::RECORD_PAIR) {
      leaves_.push_back({record, by_primitive_.at(words[0] >> 8)->vertices});
      return;
    }
    if (levels_.size() <= level) levels_.emplace_back();
    levels_[level].push_back(record);
    for (std::uint32_t slot = 0; slot < block_records; ++slot)
      visit(words[3] * block_records + slot, level + 1);
  }

  std::span<const Record> records_;
  std::map<std::uint32_t, const DeformingPair*> by_primitive_;
  std::vector<gpu::GpuRefitLeaf> leaves_;
  std::vector<std::vector<std::uint32_t>> levels_;
};

double largest_coordinate_of(const Aabb& box) {
  const glm::vec3 extent = glm::max(glm::abs(box.low), glm::abs(box.high));
  return std::max({extent.x, extent.y, extent.z});
}

bool is_empty(const Aabb& box) {
  return !(box.low.x <= box.high.x);
}

}  // namespace

std::vector<DeformingPair> deforming_pairs(const Mesh& mesh) {
  check_triangles(mesh);
  const std::vector<std::uint32_t> first = first_alike(mesh.undeformed);
  std::vector<std::array<glm::vec3, 3>> corners;
  std::vector<std::array<std::uint32_t, 3>> places;
  std::vector<std::uint32_t> primitives;
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const glm::uvec3& t = mesh.triangles[i];
    if (std::max({t.x, t.y, t.z}) >= mesh.positions.size()) continue;
    corners.push_back({mesh.positions[t.x], mesh.positions[t.y], mesh.positions[t.z]});
    places.push_back({first[t.x], first[t.y], first[t.z]});
    primitives.push_back(i);
  }
  std::vector<DeformingPair> result;
  for (const TrianglePair& pair : make_pairs(corners, primitives, places)) {
    DeformingPair indices;
    const glm::uvec3& a = mesh.triangles[pair.primitives[0]];
    const glm::uvec3& b = mesh.triangles[pair.primitives[1]];
    const int turn_a = static_cast<int>(pair.rotations[0]);
    const int turn_b = static_cast<int>(pair.rotations[1]);
    const bool is_single = pair.primitives[0] == pair.primitives[1];
    indices.vertices = {a[turn_a], a[(turn_a + 1) % 3], a[(turn_a + 2) % 3],
                        is_single ? a[(turn_a + 2) % 3] : b[(turn_b + 2) % 3]};
    indices.primitives = {pair.primitives[0], pair.primitives[1]};
    indices.rotations = {pair.rotations[0], pair.rotations[1]};
    result.push_back(indices);
  }
  return result;
}

RefittableBvh build_refittable_bvh(std::span<const DeformingPair> indices,
                                   std::span<const glm::vec3> positions) {
  RefittableBvh result;
  MeshBvh& bvh = result.bvh;
  if (indices.empty()) return result;
  for (const DeformingPair& pair : indices)
    for (int i = 0; i < 4; ++i) {
      const glm::vec3& p = positions[pair.vertices[i]];
      bvh.bounds = merged(bvh.bounds, {p, p});
    }
  bvh.grid_exponent = grid_exponent_of(bvh.bounds);
  const float scale = std::ldexp(1.0f, bvh.grid_exponent);
  std::vector<TrianglePair> pairs;
  std::vector<Aabb> boxes;
  for (const DeformingPair& from : indices) {
    TrianglePair pair;
    for (int i = 0; i < 4; ++i)
      pair.vertices[static_cast<std::size_t>(i)] = positions[from.vertices[i]] * scale;
    pair.primitives = {from.primitives.x, from.primitives.y};
    pair.rotations = {from.rotations.x, from.rotations.y};
    boxes.push_back(bounds_of(pair));
    pairs.push_back(pair);
  }
  const WideTree tree = make_tree(
      boxes, BvhQuality::medium, {}, [&](std::uint32_t i) { return pair_record(pairs[i]); },
      gpu::MESH_BVH_DEPTH);
  append_texels(bvh.texels, tree.records);
  bvh.sah_cost = tree.sah_cost;
  bvh.depth = tree.depth;
  bvh.leaves = tree.leaves;
  result.plan = Planner(tree.records, indices).plan();
  return result;
}

DeformationReach reach_of(const Mesh& mesh, std::size_t joints) {
  DeformationReach reach;
  const Undeformed& from = mesh.undeformed;
  for (const MorphTarget& target : from.targets) {
    glm::vec3 most(0);
    for (const glm::vec3& offset : target.positions) most = glm::max(most, glm::abs(offset));
    reach.targets.push_back(most);
  }
  reach.joints.resize(joints);
  for (std::size_t v = 0; v < from.positions.size(); ++v) {
    const Aabb point{from.positions[v], from.positions[v]};
    if (from.influences_per_vertex == 0) reach.whole = merged(reach.whole, point);
    for (std::uint32_t i = 0; i < from.influences_per_vertex; ++i) {
      const Influence& influence = from.influences[v * from.influences_per_vertex + i];
      for (int k = 0; k < 4; ++k) {
        if (influence.weights[k] == 0) continue;
        Aabb& joint = reach.joints[influence.joints[static_cast<std::size_t>(k)]];
        joint = merged(joint, point);
      }
    }
  }
  return reach;
}

Aabb deformed_bounds(const DeformationReach& reach, const Shape& shape) {
  glm::dvec3 offset(0);
  for (std::size_t i = 0; i < reach.targets.size(); ++i)
    offset += std::abs(shape.weights[i]) * glm::dvec3(reach.targets[i]);
  const glm::vec3 margin(offset);
  const auto widened = [&](const Aabb& box) { return Aabb{box.low - margin, box.high + margin}; };
  Aabb bounds;
  if (!is_empty(reach.whole)) bounds = widened(reach.whole);
  for (std::size_t i = 0; i < reach.joints.size(); ++i)
    if (!is_empty(reach.joints[i]))
      bounds = merged(bounds, transform_bounds(widened(reach.joints[i]), shape.joints[i]));
  // The shader's rounding, at most some 2^-21 of the coordinates.
  const auto rounding = static_cast<float>(largest_coordinate_of(bounds) * std::ldexp(1.0, -20));
  return is_empty(bounds) ? bounds : Aabb{bounds.low - rounding, bounds.high + rounding};
}

double most_moved(const DeformationReach& reach, const Shape& before, const Shape& after) {
  glm::dvec3 offset(0), moved(0);
  for (std::size_t i = 0; i < reach.targets.size(); ++i) {
    const glm::dvec3 target(reach.targets[i]);
    offset += std::max(std::abs(before.weights[i]), std::abs(after.weights[i])) * target;
    moved += std::abs(after.weights[i] - before.weights[i]) * target;
  }
  double most = is_empty(reach.whole) ? 0 : glm::length(moved);
  for (std::size_t i = 0; i < reach.joints.size(); ++i) {
    const Aabb& box = reach.joints[i];
    if (is_empty(box)) continue;
    const glm::dvec3 middle = 0.5 * (glm::dvec3(box.low) + glm::dvec3(box.high));
    const glm::dvec3 half = 0.5 * (glm::dvec3(box.high) - glm::dvec3(box.low)) + offset;
    // An affine difference is largest at a corner.
    for (int corner = 0; corner < 8; ++corner) {
      const glm::dvec3 side(corner & 1 ? 1 : -1, corner & 2 ? 1 : -1, corner & 4 ? 1 : -1);
      const glm::dvec4 point(middle + side * half, 1);
      const glm::dvec3 off(after.joints[i] * point - before.joints[i] * point);
      double of_targets = 0;
      for (int axis = 0; axis < 3; ++axis)
        of_targets += moved[axis] * glm::length(glm::dvec3(after.joints[i][axis]));
      most = std::max(most, glm::length(off) + of_targets);
    }
  }
  return most;
}

}  // namespace previz::scene
