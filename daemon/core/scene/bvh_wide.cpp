#include "daemon/core/scene/bvh_wide.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "drivers/error.hpp"
#include "shaders/lib/shared.h"

namespace previz::scene {
namespace {

constexpr int branches = 8;

// The least cost of covering a binary subtree by at most k wide subtrees, k = 1..8 (Ylitie et al.,
// section 3.1). A node and a leaf both cost one visit, times the probability of hitting their box.
struct Cover {
  std::array<float, branches + 1> cost{};
  std::array<std::uint8_t, branches + 1> left{};  // subtrees given to the left child; 0: one node
};

float cheapest_split(const Cover& left, const Cover& right, int k, std::uint8_t& left_count) {
  float best = std::numeric_limits<float>::infinity();
  for (int j = 1; j < k; ++j) {
    const float cost = left.cost[j] + right.cost[k - j];
    if (cost >= best) continue;
    best = cost;
    left_count = static_cast<std::uint8_t>(j);
  }
  return best;
}

std::vector<Cover> cover(std::span<const BinaryNode> binary) {
  std::vector<Cover> covers(binary.size());
  for (std::size_t i = binary.size(); i-- > 0;) {
    const BinaryNode& node = binary[i];
    Cover& c = covers[i];
    const auto area = static_cast<float>(half_area(node.bounds));
    if (node.left == 0) {
      c.cost.fill(area);
      continue;
    }
    std::array<std::uint8_t, branches + 1> split{};
    std::array<float, branches + 1> divided{};
    for (int k = 2; k <= branches; ++k)
      divided[k] = cheapest_split(covers[node.left], covers[node.right], k, split[k]);
    c.cost[1] = area + divided[branches];
    c.left[1] = split[branches];  // how the children are divided if this becomes a wide node
    for (int k = 2; k <= branches; ++k) {
      c.cost[k] = std::min(divided[k], c.cost[1]);
      c.left[k] = divided[k] < c.cost[1] ? split[k] : std::uint8_t{0};
    }
  }
  return covers;
}

class Collapse {
 public:
  Collapse(std::span<const BinaryNode> binary, const std::function<Record(std::uint32_t)>& leaf)
      : binary_(binary), leaf_(leaf), covers_(cover(binary)) {}

  WideTree run() {
    tree_.records.resize(branches);
    root_area_ = half_area(binary_[0].bounds);
    if (binary_[0].left == 0) {
      // A lone leaf still gets a node above it.
      tree_.records.resize(2 * branches);
      const std::array<std::uint32_t, 1> children{0};
      encode(0, children, 1);
      add_cost(0);
      tree_.depth = 1;
    } else {
      emit(0, 0, 1);
    }
    return std::move(tree_);
  }

 private:
  void gather(std::uint32_t node, int k, std::vector<std::uint32_t>& children) const {
    if (binary_[node].left == 0 || k == 1 || covers_[node].left[k] == 0) {
      children.push_back(node);
      return;
    }
    const int left = covers_[node].left[k];
    gather(binary_[node].left, left, children);
    gather(binary_[node].right, k - left, children);
  }

  // Writes the record of a wide node and then those of its descendants.
  void emit(std::uint32_t node, std::size_t record, std::uint32_t level) {
    tree_.depth = std::max(tree_.depth, level);
    add_cost(node);
    std::vector<std::uint32_t> children;
    const int left = covers_[node].left[1];
    gather(binary_[node].left, left, children);
    gather(binary_[node].right, branches - left, children);

    const std::size_t block = tree_.records.size() / branches;
    tree_.records.resize(tree_.records.size() + branches);
    const auto slots = encode(record, children, block);
    for (int slot = 0; slot < branches; ++slot) {
      if (slots[slot] == none || binary_[slots[slot]].left == 0) continue;
      emit(slots[slot], block * branches + static_cast<std::size_t>(slot), level + 1);
    }
  }

  void add_cost(std::uint32_t node) {
    tree_.sah_cost += root_area_ > 0 ? half_area(binary_[node].bounds) / root_area_ : 1;
  }

  // Assigns children to slots: repeatedly the pair of child and slot whose child lies farthest
  // towards the slot's octant (greedy form of the paper's assignment).
  std::array<std::uint32_t, branches> assign_slots(std::span<const std::uint32_t> children,
                                                   const Aabb& bounds) const {
    const glm::vec3 middle = bounds.low + bounds.high;
    std::array<std::array<float, branches>, branches> gain;  // child, slot
    for (std::size_t c = 0; c < children.size(); ++c) {
      const Aabb& box = binary_[children[c]].bounds;
      const glm::vec3 offset = box.low + box.high - middle;
      for (int slot = 0; slot < branches; ++slot)
        gain[c][slot] = (slot & 1 ? offset.x : -offset.x) + (slot & 2 ? offset.y : -offset.y) +
                        (slot & 4 ? offset.z : -offset.z);
    }
    std::array<std::uint32_t, branches> slots;
    slots.fill(none);
    std::array<bool, branches> placed{};
    for (std::size_t round = 0; round < children.size(); ++round) {
      float best = -std::numeric_limits<float>::infinity();
      std::size_t best_child = 0, best_slot = 0;
      for (std::size_t c = 0; c < children.size(); ++c) {
        for (std::size_t slot = 0; slot < branches; ++slot) {
          if (placed[c] || slots[slot] != none || gain[c][slot] <= best) continue;
          best = gain[c][slot];
          best_child = c;
          best_slot = slot;
        }
      }
      placed[best_child] = true;
      slots[best_slot] = children[best_child];
    }
    return slots;
  }

  // Writes a node's record and its leaves' records in the children's block.
  std::array<std::uint32_t, branches> encode(std::size_t record,
                                             std::span<const std::uint32_t> children,
                                             std::size_t block) {
    Aabb bounds;
    for (const std::uint32_t child : children) bounds = merged(bounds, binary_[child].bounds);
    const auto slots = assign_slots(children, bounds);
    Record words{};
    words[3] = static_cast<std::uint32_t>(block);
    for (int axis = 0; axis < 3; ++axis) encode_axis(words, axis, bounds, slots);
    tree_.records[record] = words;
    for (std::size_t slot = 0; slot < branches; ++slot) {
      if (slots[slot] == none || binary_[slots[slot]].left != 0) continue;
      add_cost(slots[slot]);
      ++tree_.leaves;
      tree_.records[block * branches + slot] = leaf_(binary_[slots[slot]].primitive);
    }
    return slots;
  }

  void encode_axis(Record& words, int axis, const Aabb& bounds,
                   const std::array<std::uint32_t, branches>& slots) const {
    const double origin = std::floor(bounds.low[axis]);
    int exponent = 0;
    while (std::ceil(std::ldexp(bounds.high[axis] - origin, -exponent)) > 255) ++exponent;
    words[axis] = static_cast<std::uint32_t>(static_cast<std::int32_t>(origin)) << 8 |
                  (gpu::RECORD_NODE + static_cast<std::uint32_t>(exponent));
    const std::size_t first = 4 + 4 * static_cast<std::size_t>(axis);
    for (std::size_t slot = 0; slot < branches; ++slot) {
      std::uint32_t low = 255, high = 0;
      if (slots[slot] != none) {
        const Aabb& box = binary_[slots[slot]].bounds;
        low = static_cast<std::uint32_t>(std::floor(std::ldexp(box.low[axis] - origin, -exponent)));
        high =
            static_cast<std::uint32_t>(std::ceil(std::ldexp(box.high[axis] - origin, -exponent)));
      }
      const auto shift = 8 * (slot % 4);
      words[first + slot / 4] |= low << shift;
      words[first + 2 + slot / 4] |= high << shift;
    }
  }

  static constexpr std::uint32_t none = 0xffffffffu;

  std::span<const BinaryNode> binary_;
  const std::function<Record(std::uint32_t)>& leaf_;
  std::vector<Cover> covers_;
  double root_area_ = 0;
  WideTree tree_;
};

}  // namespace

WideTree make_wide_tree(std::span<const BinaryNode> binary,
                        const std::function<Record(std::uint32_t primitive)>& leaf) {
  return Collapse(binary, leaf).run();
}

WideTree make_tree(std::span<const Aabb> boxes, BvhQuality quality, const SplitPrimitive& split,
                   const std::function<Record(std::uint32_t)>& leaf, std::uint32_t most_levels) {
  WideTree tree = make_wide_tree(build_binary_tree(boxes, quality, split), leaf);
  if (tree.depth > most_levels) tree = make_wide_tree(build_balanced_tree(boxes), leaf);
  if (tree.depth > most_levels)
    throw Error("scene: a BVH over " + std::to_string(boxes.size()) + " boxes needs " +
                std::to_string(tree.depth) + " levels; at most " + std::to_string(most_levels) +
                " are allowed");
  return tree;
}

std::uint32_t with_fill(std::uint32_t value, std::uint32_t rotation) {
  return value << 8 | (gpu::RECORD_FILL + rotation);
}

int grid_exponent(double extent) {
  if (extent <= 0) return 0;
  int exponent = 0;
  std::frexp(extent, &exponent);  // extent < 2^exponent
  // Beyond these exponents the squared length of a direction in grid space leaves the range of a
  // float.
  return std::clamp(23 - exponent, -48, 48);
}

void append_texels(std::vector<glm::uvec4>& texels, std::span<const Record> records) {
  texels.reserve(texels.size() + 4 * records.size());
  for (const Record& r : records)
    for (std::size_t i = 0; i < r.size(); i += 4)
      texels.emplace_back(r[i], r[i + 1], r[i + 2], r[i + 3]);
}

}  // namespace previz::scene
