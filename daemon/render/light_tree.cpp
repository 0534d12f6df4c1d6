#include "daemon/render/light_tree.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <span>

#include "daemon/render/gpu_lights.hpp"

namespace previz::render {
namespace {

constexpr double half_turn = std::numbers::pi;
constexpr double no_bound = std::numeric_limits<double>::infinity();

// Below this depth nodes are halved, so that no tree is deeper than the shaders descend.
constexpr int most_uneven_depth = 32;
constexpr int tree_bins = 12;

// Single precision may turn a direction by 1e-7 of its length; cosines are compared with this much
// to spare.
constexpr double cosine_margin = 1e-4;

// The directions in which lamps shine: all that are within `falloff` of a direction within `spread`
// of the axis (theta_e and theta_o of Conty Estevez and Kulla 2018). A lamp with two sides shines
// the other way as well.
struct LampCone {
  glm::dvec3 axis{0, 0, 1};
  double spread_rad = 0;
  double falloff_rad = 0;
  bool is_two_sided = false;
};

struct LampBounds {
  glm::dvec3 low{no_bound}, high{-no_bound};
  LampCone cone;
  double intensity = 0;  // the sum of what the lamps send along their brightest direction, W/sr
};

struct LampLeaf {
  LampBounds bounds;
  glm::dvec3 center;
  std::uint32_t light;
};

double angle_between(const glm::dvec3& a, const glm::dvec3& b) {
  return std::acos(std::clamp(glm::dot(a, b), -1.0, 1.0));
}

LampCone joined_cones(LampCone a, LampCone b) {
  if (b.spread_rad > a.spread_rad) std::swap(a, b);
  a.is_two_sided = a.is_two_sided || b.is_two_sided;
  a.falloff_rad = std::max(a.falloff_rad, b.falloff_rad);
  if (a.is_two_sided && glm::dot(a.axis, b.axis) < 0) b.axis = -b.axis;
  const double between = angle_between(a.axis, b.axis);
  if (std::min(between + b.spread_rad, half_turn) <= a.spread_rad) return a;
  const double spread = (a.spread_rad + between + b.spread_rad) / 2;
  const glm::dvec3 across = b.axis - glm::dot(a.axis, b.axis) * a.axis;
  if (spread >= half_turn || !(glm::length(across) > 1e-12)) {
    a.spread_rad = half_turn;
    return a;
  }
  const double turn = spread - a.spread_rad;
  a.axis = glm::normalize(std::cos(turn) * a.axis + std::sin(turn) * glm::normalize(across));
  a.spread_rad = spread;
  return a;
}

void join(LampBounds& to, const LampBounds& other) {
  to.cone = to.intensity > 0 ? joined_cones(to.cone, other.cone) : other.cone;
  to.low = glm::min(to.low, other.low);
  to.high = glm::max(to.high, other.high);
  to.intensity += other.intensity;
}

LampCone cone_of(const gpu::GpuLight& light) {
  LampCone cone{.axis = glm::dvec3(light.direction)};
  if (light.type == gpu::LIGHT_SPOT)  // within its cone it is taken to shine evenly
    cone.spread_rad = std::acos(std::clamp<double>(light.cos_outer, -1, 1));
  else
    cone.falloff_rad = half_turn / 2;
  if (light.type == gpu::LIGHT_POINT || light.type == gpu::LIGHT_SPHERE)
    cone.spread_rad = half_turn;
  cone.is_two_sided = light.type == gpu::LIGHT_TRIANGLE;
  return cone;
}

LampBounds bounds_of(const gpu::GpuLight& light, double intensity) {
  LampBounds bounds{.cone = cone_of(light), .intensity = intensity};
  const glm::dvec3 at(light.position), u(light.edge_u), v(light.edge_v);
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
  bounds.low = at + low;
  bounds.high = at + high;
  return bounds;
}

bool is_finite(const LampBounds& bounds) {
  const glm::dvec3 zero = 0.0 * (bounds.high - bounds.low) + 0.0 * bounds.cone.axis;
  return zero == glm::dvec3(0) && std::isfinite(bounds.intensity);
}

// Returns the measure of the directions in which the lamps of a cone shine (equation 1 of the
// paper); at least a narrow beam's, so that lamps of no extent in angle still differ in place.
double measure(const LampCone& cone) {
  const double spread = cone.spread_rad;
  const double whole = std::min(spread + cone.falloff_rad, half_turn);
  const double inner = 2 * half_turn * (1 - std::cos(spread));
  const double outer = half_turn / 2 *
                       (2 * whole * std::sin(spread) - std::cos(spread - 2 * whole) -
                        2 * spread * std::sin(spread) + std::cos(spread));
  return std::max(inner + outer, 1e-3) * (cone.is_two_sided ? 2 : 1);
}

// The heuristic weighs the surface of the sphere around the box: unlike the box's own it is not
// zero for lamps in a row.
double tree_cost(const LampBounds& bounds) {
  if (!(bounds.intensity > 0)) return 0;
  const glm::dvec3 size = bounds.high - bounds.low;
  return bounds.intensity * glm::dot(size, size) * measure(bounds.cone);
}

class LightTreeBuilder {
 public:
  LightTreeBuilder(LightTree& tree, std::vector<gpu::GpuLight>& lights)
      : tree_(tree), lights_(lights) {}

  void build(std::span<LampLeaf> leaves, std::size_t node, std::size_t parent, int depth);

 private:
  std::size_t split(std::span<LampLeaf> leaves, const LampBounds& bounds, int depth) const;
  void write(std::size_t node, std::size_t parent, const LampBounds& bounds);

  LightTree& tree_;
  std::vector<gpu::GpuLight>& lights_;
};

void LightTreeBuilder::write(std::size_t node, std::size_t parent, const LampBounds& bounds) {
  gpu::GpuLightNode& n = tree_.nodes[node];
  const glm::dvec3 center = 0.5 * (bounds.low + bounds.high) - tree_.origin;
  // The radius covers what the rounding of the places to single precision may shift them by.
  const double radius = 0.5 * glm::length(bounds.high - bounds.low);
  const double rounding = 1e-6 * glm::length(center);
  n.center = glm::vec3(center);
  n.radius_squared =
      radius > 0 ? static_cast<float>((radius + rounding) * (radius + rounding)) : 0.0f;
  n.axis = glm::vec3(bounds.cone.axis);
  n.intensity = static_cast<float>(bounds.intensity);
  n.cos_spread = static_cast<float>(std::cos(bounds.cone.spread_rad));
  n.least_cosine = static_cast<float>(std::cos(bounds.cone.falloff_rad) - cosine_margin);
  n.links = static_cast<std::uint32_t>(parent) << gpu::LIGHT_NODE_PARENT_SHIFT;
  if (bounds.cone.is_two_sided) n.links |= gpu::LIGHT_NODE_TWO_SIDED;
}

// Returns how many of the leaves, which are reordered, go into the first child.
std::size_t LightTreeBuilder::split(std::span<LampLeaf> leaves, const LampBounds& bounds,
                                    int depth) const {
  glm::dvec3 low(no_bound), high(-no_bound);
  for (const LampLeaf& leaf : leaves) {
    low = glm::min(low, leaf.center);
    high = glm::max(high, leaf.center);
  }
  const glm::dvec3 size = bounds.high - bounds.low;
  const double longest = std::max({size.x, size.y, size.z});
  const auto bin_of = [&](const LampLeaf& leaf, int axis) {
    const double at = (leaf.center[axis] - low[axis]) / (high[axis] - low[axis]);
    return std::min(static_cast<int>(at * tree_bins), tree_bins - 1);
  };
  double least = no_bound;
  int best_axis = -1, best_bin = 0;
  for (int axis = 0; axis < 3 && depth < most_uneven_depth; ++axis) {
    if (!(high[axis] > low[axis])) continue;
    std::array<LampBounds, tree_bins> in_bin;
    for (const LampLeaf& leaf : leaves)
      join(in_bin[static_cast<std::size_t>(bin_of(leaf, axis))], leaf.bounds);
    std::array<double, tree_bins> behind{};
    LampBounds right, left;
    for (std::size_t i = tree_bins - 1; i > 0; --i) {
      if (in_bin[i].intensity > 0) join(right, in_bin[i]);
      behind[i] = tree_cost(right);
    }
    for (std::size_t i = 0; i + 1 < tree_bins; ++i) {
      if (in_bin[i].intensity > 0) join(left, in_bin[i]);
      // Thin boxes are kept from being cut into thinner ones (the paper's K_r).
      const double all = (tree_cost(left) + behind[i + 1]) * longest / size[axis];
      if (all >= least) continue;
      least = all;
      best_axis = axis;
      best_bin = static_cast<int>(i);
    }
  }
  if (best_axis >= 0) {
    const auto second = std::partition(leaves.begin(), leaves.end(), [&](const LampLeaf& leaf) {
      return bin_of(leaf, best_axis) <= best_bin;
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

void LightTreeBuilder::build(std::span<LampLeaf> leaves, std::size_t node, std::size_t parent,
                             int depth) {
  LampBounds bounds;
  for (const LampLeaf& leaf : leaves) join(bounds, leaf.bounds);
  write(node, parent, bounds);
  if (leaves.size() == 1) {
    tree_.nodes[node].first = leaves.front().light;
    tree_.nodes[node].links |= gpu::LIGHT_NODE_LEAF;
    lights_[leaves.front().light].leaf = static_cast<std::uint32_t>(node);
    return;
  }
  const std::size_t in_first = split(leaves, bounds, depth);
  const std::size_t children = tree_.nodes.size();
  tree_.nodes.resize(children + 2);
  tree_.nodes[node].first = static_cast<std::uint32_t>(children);
  build(leaves.first(in_first), children, node, depth + 1);
  build(leaves.subspan(in_first), children + 1, node, depth + 1);
}

}  // namespace

LightTree build_light_tree(std::vector<gpu::GpuLight>& lights, const Weights& weights) {
  LightTree tree;
  tree.nodes.resize(2);  // the children of a node are two neighbours, the first of even index
  std::vector<LampLeaf> leaves;
  LampBounds all;
  double most = 0;
  for (std::size_t i = 0; i < lights.size(); ++i) {
    lights[i].leaf = gpu::NO_INDEX;
    if (lights[i].type == gpu::LIGHT_DIRECTIONAL) continue;
    const LampBounds bounds = bounds_of(lights[i], intensity(lights[i]) * weights.of(i));
    if (!(bounds.intensity > 0) || !is_finite(bounds)) continue;
    leaves.push_back({bounds, 0.5 * (bounds.low + bounds.high), static_cast<std::uint32_t>(i)});
    all.low = glm::min(all.low, bounds.low);
    all.high = glm::max(all.high, bounds.high);
    most = std::max(most, bounds.intensity);
  }
  if (leaves.empty()) return tree;
  // Only ratios count: no unit of radiance leaves single precision's range.
  for (LampLeaf& leaf : leaves) leaf.bounds.intensity /= most;
  tree.origin = 0.5 * (all.low + all.high);
  LightTreeBuilder(tree, lights).build(leaves, 0, 0, 0);
  return tree;
}

}  // namespace previz::render
