#include "daemon/core/render/world/light_tree.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <span>
#include <utility>

namespace previz::render {
namespace {

constexpr double half_turn = std::numbers::pi;
constexpr double no_bound = std::numeric_limits<double>::infinity();

// Below this depth nodes are halved, so that no tree is deeper than the shaders descend.
constexpr int most_uneven_depth = 32;

// Single precision may turn a direction by 1e-7 of its length; cosines are compared with this much
// to spare.
constexpr double cosine_margin = 1e-4;

// The directions in which lamps shine: all that are within `falloff` of a direction within `spread`
// of the axis (theta_e and theta_o of Conty Estevez and Kulla 2018). A lamp with two sides shines
// the other way as well.
struct LampCone {
  glm::dvec3 axis{0, 0, 1};
  double spread_rad = 0;
  double cos_spread = 1, sin_spread = 0;
  double falloff_rad = 0;
  bool is_two_sided = false;

  void spread_to(double angle) {
    spread_rad = angle;
    cos_spread = std::cos(angle);
    sin_spread = std::sin(angle);
  }
};

struct LampBounds {
  glm::dvec3 low{no_bound}, high{-no_bound};
  LampCone cone;
  double intensity = 0;  // the sum of what the lamps send along their brightest direction, W/sr
};

struct LampLeaf {
  LampBounds bounds;
  glm::dvec3 center;
  std::uint32_t lamp;
};

// Returns whether the axes within a's spread contain those within b's, by the sine and cosine of
// b's spread and the angle between the axes together.
bool contains(const LampCone& a, const LampCone& b, double cosine) {
  const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  const bool is_below_half_turn = sine * b.cos_spread + cosine * b.sin_spread >= 0;
  return is_below_half_turn && cosine * b.cos_spread - sine * b.sin_spread >= a.cos_spread;
}

LampCone joined_cones(LampCone a, LampCone b) {
  if (b.spread_rad > a.spread_rad) std::swap(a, b);
  a.is_two_sided = a.is_two_sided || b.is_two_sided;
  a.falloff_rad = std::max(a.falloff_rad, b.falloff_rad);
  if (a.is_two_sided && glm::dot(a.axis, b.axis) < 0) b.axis = -b.axis;
  const double cosine = std::clamp(glm::dot(a.axis, b.axis), -1.0, 1.0);
  if (a.spread_rad >= half_turn || contains(a, b, cosine)) return a;
  const double spread = (a.spread_rad + std::acos(cosine) + b.spread_rad) / 2;
  const glm::dvec3 across = b.axis - cosine * a.axis;
  if (spread >= half_turn || !(glm::length(across) > 1e-12)) {
    a.spread_to(half_turn);
    return a;
  }
  const double turn = spread - a.spread_rad;
  a.axis = glm::normalize(std::cos(turn) * a.axis + std::sin(turn) * glm::normalize(across));
  a.spread_to(spread);
  return a;
}

void join(LampBounds& to, const LampBounds& other) {
  if (!(other.intensity > 0)) return;
  to.cone = to.intensity > 0 ? joined_cones(to.cone, other.cone) : other.cone;
  to.low = glm::min(to.low, other.low);
  to.high = glm::max(to.high, other.high);
  to.intensity += other.intensity;
}

LampCone cone_of(const gpu::GpuLight& light) {
  LampCone cone{.axis = glm::dvec3(light.direction)};
  if (light.type == gpu::LIGHT_SPOT)  // within its cone it is taken to shine evenly
    cone.spread_to(std::acos(std::clamp<double>(light.cos_outer, -1, 1)));
  else
    cone.falloff_rad = half_turn / 2;
  if (light.type == gpu::LIGHT_POINT || light.type == gpu::LIGHT_SPHERE) cone.spread_to(half_turn);
  cone.is_two_sided = light.type == gpu::LIGHT_TRIANGLE;
  return cone;
}

// Returns the bounds of a light; those of none for what has no place, no power or no finite size.
LampBounds lamp_bounds(const PlacedLights& all, std::size_t i) {
  const gpu::GpuLight& light = all.lights[i];
  if (light.type == gpu::LIGHT_DIRECTIONAL) return {};
  LampBounds bounds{.cone = cone_of(light), .intensity = intensity(light) * all.weights.of(i)};
  const glm::dvec3 u(light.edge_u), v(light.edge_v);
  glm::dvec3 low(0), high(0);
  if (light.type == gpu::LIGHT_SPHERE) {
    high = glm::dvec3(light.radius);
    low = -high;
  } else if (light.type == gpu::LIGHT_RECTANGLE) {
    high = 0.5 * (glm::abs(u) + glm::abs(v));
    low = -high;
  } else if (light.type == gpu::LIGHT_TRIANGLE) {
    low = glm::min(glm::min(u, v), glm::dvec3(0));
    high = glm::max(glm::max(u, v), glm::dvec3(0));
  }
  bounds.low = all.positions[i] + low;
  bounds.high = all.positions[i] + high;
  const glm::dvec3 zero = 0.0 * (bounds.low + bounds.high) + 0.0 * bounds.cone.axis;
  const bool is_finite = zero == glm::dvec3(0) && std::isfinite(bounds.intensity);
  return is_finite && bounds.intensity > 0 ? bounds : LampBounds{};
}

// Returns the measure of the directions in which the lamps of a cone shine (equation 1 of the
// paper); at least a narrow beam's, so that lamps of no extent in angle still differ in place.
double measure(const LampCone& cone) {
  const double spread = cone.spread_rad;
  const double whole = std::min(spread + cone.falloff_rad, half_turn);
  const double inner = 2 * half_turn * (1 - cone.cos_spread);
  const double outer =
      half_turn / 2 *
      (2 * (whole - spread) * cone.sin_spread - std::cos(spread - 2 * whole) + cone.cos_spread);
  return std::max(inner + outer, 1e-3) * (cone.is_two_sided ? 2 : 1);
}

// The heuristic weighs the surface of the sphere around the box: unlike the box's own it is not
// zero for lamps in a row.
double tree_cost(const LampBounds& bounds) {
  if (!(bounds.intensity > 0)) return 0;
  const glm::dvec3 size = bounds.high - bounds.low;
  return bounds.intensity * glm::dot(size, size) * measure(bounds.cone);
}

// The box of the leaves' centres in equal parts along each axis.
struct LampBins {
  explicit LampBins(std::span<const LampLeaf> leaves) {
    for (const LampLeaf& leaf : leaves) {
      low = glm::min(low, leaf.center);
      high = glm::max(high, leaf.center);
    }
  }
  bool has_width(int axis) const { return high[axis] > low[axis]; }
  std::size_t of(const LampLeaf& leaf, int axis) const {
    const double at = (leaf.center[axis] - low[axis]) / (high[axis] - low[axis]);
    return std::min(static_cast<std::size_t>(at * static_cast<double>(count)), count - 1);
  }

  static constexpr std::size_t count = 12;
  glm::dvec3 low{no_bound}, high{-no_bound};
};

// The leaves up to and including a bin go into the first child.
struct LampCut {
  double cost = no_bound;
  int axis = 0;
  std::size_t bin = 0;
};

// Returns the cut along an axis by which the costs of both parts are least.
LampCut best_cut(std::span<const LampLeaf> leaves, const LampBins& bins, int axis) {
  std::array<LampBounds, LampBins::count> in_bin;
  for (const LampLeaf& leaf : leaves) join(in_bin[bins.of(leaf, axis)], leaf.bounds);
  std::array<double, LampBins::count> behind{};  // of all bins behind this one
  LampBounds right, left;
  for (std::size_t i = LampBins::count; i-- > 1;) {
    join(right, in_bin[i]);
    behind[i - 1] = tree_cost(right);
  }
  LampCut best{.axis = axis};
  for (std::size_t i = 0; i + 1 < LampBins::count; ++i) {
    join(left, in_bin[i]);
    const double cost = tree_cost(left) + behind[i];
    if (cost < best.cost) {
      best.cost = cost;
      best.bin = i;
    }
  }
  return best;
}

// Returns how many of the leaves, which are reordered, go into the first child.
std::size_t split(std::span<LampLeaf> leaves, const LampBounds& bounds, int depth) {
  const glm::dvec3 size = bounds.high - bounds.low;
  const double longest = std::max({size.x, size.y, size.z});
  const LampBins bins(leaves);
  LampCut best;
  for (int axis = 0; axis < 3 && depth < most_uneven_depth; ++axis) {
    if (!bins.has_width(axis)) continue;
    LampCut cut = best_cut(leaves, bins, axis);
    cut.cost *= longest / size[axis];  // thin boxes are not cut into thinner ones (the paper's K_r)
    if (cut.cost < best.cost) best = cut;
  }
  if (best.cost < no_bound) {
    const auto second = std::partition(leaves.begin(), leaves.end(), [&](const LampLeaf& leaf) {
      return bins.of(leaf, best.axis) <= best.bin;
    });
    const auto first = static_cast<std::size_t>(second - leaves.begin());
    if (first > 0 && first < leaves.size()) return first;
  }
  const int axis = size.x == longest ? 0 : size.y == longest ? 1 : 2;
  const auto middle = leaves.begin() + static_cast<std::ptrdiff_t>(leaves.size() / 2);
  std::nth_element(leaves.begin(), middle, leaves.end(), [&](const LampLeaf& a, const LampLeaf& b) {
    return a.center[axis] < b.center[axis];
  });
  return leaves.size() / 2;
}

void grow(LightShape& shape, std::span<LampLeaf> leaves, std::size_t node, int depth) {
  if (leaves.size() == 1) {
    shape[node] = {leaves.front().lamp, true};
    return;
  }
  LampBounds bounds;
  for (const LampLeaf& leaf : leaves) join(bounds, leaf.bounds);
  const std::size_t in_first = split(leaves, bounds, depth);
  const std::size_t children = shape.size();
  shape.resize(children + 2);
  shape[node] = {static_cast<std::uint32_t>(children), false};
  grow(shape, leaves.first(in_first), children, depth + 1);
  grow(shape, leaves.subspan(in_first), children + 1, depth + 1);
}

// Each leaf of the shape is the `lamp` of one of the given ones.
LightShape shape_of(std::vector<LampLeaf> leaves) {
  LightShape shape;
  if (leaves.empty()) return shape;
  shape.resize(1);
  grow(shape, leaves, 0, 0);
  return shape;
}

// A shape and the bounds of its nodes, given those of its leaves.
struct BoundedShape {
  BoundedShape(const LightShape& the_shape, const auto& bounds_of_leaf)
      : shape(&the_shape), bounds(the_shape.size()) {
    for (std::size_t i = bounds.size(); i-- > 0;) {
      const LightBranch& branch = the_shape[i];
      if (branch.is_leaf) {
        bounds[i] = bounds_of_leaf(branch.first);
      } else {
        bounds[i] = bounds[branch.first];
        join(bounds[i], bounds[branch.first + 1]);
      }
    }
  }

  const LightShape* shape;
  std::vector<LampBounds> bounds;
};

// Writes the nodes in the layout of the shaders. Only ratios of intensities count, so that they are
// divided by the root's: no unit of radiance leaves single precision's range.
class LightTreeWriter {
 public:
  LightTreeWriter(LightTree& tree, PlacedLights& lights, std::span<const LightGroup> groups,
                  std::span<const BoundedShape> bounded, double whole)
      : tree_(tree), lights_(lights), groups_(groups), bounded_(bounded), whole_(whole) {}

  // Writes what is at `from` of the lamps' and groups' own tree. `next` is the node behind all
  // below this one; 0: there is none.
  void write_top(const BoundedShape& top, std::uint32_t from, std::size_t node, std::size_t next);

 private:
  void write_group(std::size_t group, std::uint32_t from, std::size_t node, std::size_t next);
  void write(std::size_t node, std::size_t next, const LampBounds& bounds);
  void write_leaf(std::size_t node, std::uint32_t light);
  std::size_t add_children(std::size_t node);

  LightTree& tree_;
  PlacedLights& lights_;
  std::span<const LightGroup> groups_;
  std::span<const BoundedShape> bounded_;  // of the groups
  double whole_;
};

void LightTreeWriter::write(std::size_t node, std::size_t next, const LampBounds& bounds) {
  gpu::GpuLightNode& n = tree_.nodes[node];
  n.links = static_cast<std::uint32_t>(next) << gpu::LIGHT_NODE_NEXT_SHIFT;
  if (!(bounds.intensity > 0)) return;  // its intensity stays 0
  const glm::dvec3 center = 0.5 * (bounds.low + bounds.high) - tree_.origin;
  // The radius covers what the rounding of the places to single precision may shift them by.
  const double radius = 0.5 * glm::length(bounds.high - bounds.low);
  const double rounding = 1e-6 * glm::length(center);
  n.center = glm::vec3(center);
  n.radius_squared =
      radius > 0 ? static_cast<float>((radius + rounding) * (radius + rounding)) : 0.0f;
  n.axis = glm::vec3(bounds.cone.axis);
  n.intensity = static_cast<float>(bounds.intensity / whole_);
  n.cos_spread = static_cast<float>(bounds.cone.cos_spread);
  n.least_cosine = static_cast<float>(std::cos(bounds.cone.falloff_rad) - cosine_margin);
  if (bounds.cone.is_two_sided) n.links |= gpu::LIGHT_NODE_TWO_SIDED;
}

void LightTreeWriter::write_leaf(std::size_t node, std::uint32_t light) {
  tree_.nodes[node].first = light;
  tree_.nodes[node].links |= gpu::LIGHT_NODE_LEAF;
  gpu::GpuLight& lamp = lights_.lights[light];
  lamp.leaf = static_cast<std::uint32_t>(node);
  if (lamp.type != gpu::LIGHT_SPHERE && lamp.type != gpu::LIGHT_RECTANGLE) return;
  tree_.nodes[node].links |= gpu::LIGHT_NODE_VISIBLE;
  if (lamp.gain_mixed != lamp.gain_real) tree_.nodes[node].links |= gpu::LIGHT_NODE_DIFFERS;
}

std::size_t LightTreeWriter::add_children(std::size_t node) {
  const std::size_t children = tree_.nodes.size();
  tree_.nodes.resize(children + 2);
  tree_.nodes[node].first = static_cast<std::uint32_t>(children);
  return children;
}

void LightTreeWriter::write_group(std::size_t group, std::uint32_t from, std::size_t node,
                                  std::size_t next) {
  const BoundedShape& bounded = bounded_[group];
  write(node, next, bounded.bounds[from]);
  const LightBranch& branch = (*bounded.shape)[from];
  if (branch.is_leaf) return write_leaf(node, groups_[group].first_light + branch.first);
  const std::size_t children = add_children(node);
  write_group(group, branch.first, children, children + 1);
  write_group(group, branch.first + 1, children + 1, next);
}

void LightTreeWriter::write_top(const BoundedShape& top, std::uint32_t from, std::size_t node,
                                std::size_t next) {
  const LightBranch& branch = (*top.shape)[from];
  const std::size_t lights = lights_.lights.size();
  if (branch.is_leaf && branch.first >= lights)
    return write_group(branch.first - lights, 0, node, next);
  write(node, next, top.bounds[from]);
  if (branch.is_leaf) return write_leaf(node, branch.first);
  const std::size_t children = add_children(node);
  write_top(top, branch.first, children, children + 1);
  write_top(top, branch.first + 1, children + 1, next);
  tree_.nodes[node].links |= (tree_.nodes[children].links | tree_.nodes[children + 1].links) &
                             (gpu::LIGHT_NODE_VISIBLE | gpu::LIGHT_NODE_DIFFERS);
}

void add_leaf(std::vector<LampLeaf>& leaves, const LampBounds& bounds, std::size_t lamp) {
  if (bounds.intensity > 0)
    leaves.push_back({bounds, 0.5 * (bounds.low + bounds.high), static_cast<std::uint32_t>(lamp)});
}

}  // namespace

LightShape shape_of_emitter(const PlacedLights& lights) {
  std::vector<LampLeaf> leaves;
  for (std::size_t i = 0; i < lights.lights.size(); ++i)
    add_leaf(leaves, lamp_bounds(lights, i), i);
  return shape_of(std::move(leaves));
}

LightTree build_light_tree(PlacedLights& lights, std::size_t lamps,
                           std::span<const LightGroup> groups) {
  LightTree tree;
  tree.nodes.resize(2);  // the children of a node are two neighbours, the first of even index
  for (gpu::GpuLight& light : lights.lights) light.leaf = gpu::NO_INDEX;
  std::vector<LampLeaf> leaves;
  for (std::size_t i = 0; i < lamps; ++i) add_leaf(leaves, lamp_bounds(lights, i), i);
  std::vector<BoundedShape> bounded;
  bounded.reserve(groups.size());
  for (std::size_t g = 0; g < groups.size(); ++g) {
    bounded.emplace_back(*groups[g].shape, [&](std::uint32_t lamp) {
      return lamp_bounds(lights, groups[g].first_light + lamp);
    });
    if (!groups[g].shape->empty())
      add_leaf(leaves, bounded[g].bounds.front(), lights.lights.size() + g);
  }
  const LightShape shape = shape_of(leaves);
  if (shape.empty()) return tree;
  const BoundedShape top(shape, [&](std::uint32_t lamp) {
    const std::size_t own = lights.lights.size();
    return lamp < own ? lamp_bounds(lights, lamp) : bounded[lamp - own].bounds.front();
  });
  std::size_t count = tree.nodes.size() + shape.size();
  for (const LightGroup& group : groups) count += group.shape->size();
  tree.nodes.reserve(count);
  const LampBounds& all = top.bounds.front();
  tree.origin = 0.5 * (all.low + all.high);
  LightTreeWriter(tree, lights, groups, bounded, all.intensity).write_top(top, 0, 0, 0);
  return tree;
}

}  // namespace previz::render
