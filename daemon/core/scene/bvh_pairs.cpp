#include "daemon/core/scene/bvh_pairs.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "daemon/core/scene/bvh_binary.hpp"
#include "shaders/lib/shared.h"

namespace previz::scene {
namespace {

using Corners = std::array<glm::vec3, 3>;

// A pair costs one visit where two triangles cost two, but its box is met more often.
constexpr double most_growth = 1.05;

bool before(const glm::vec3& a, const glm::vec3& b) {
  return a.x != b.x ? a.x < b.x : a.y != b.y ? a.y < b.y : a.z < b.z;
}

// Numbers the places: equal positions have equal numbers (-0 equals 0).
std::vector<std::array<std::uint32_t, 3>> places_of(std::span<const Corners> corners) {
  std::vector<std::uint32_t> order(corners.size() * 3);
  std::iota(order.begin(), order.end(), 0u);
  const auto at = [&](std::uint32_t i) -> const glm::vec3& { return corners[i / 3][i % 3]; };
  std::sort(order.begin(), order.end(),
            [&](std::uint32_t a, std::uint32_t b) { return before(at(a), at(b)); });
  std::vector<std::array<std::uint32_t, 3>> places(corners.size());
  std::uint32_t place = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && before(at(order[i - 1]), at(order[i]))) ++place;
    places[order[i] / 3][order[i] % 3] = place;
  }
  return places;
}

Aabb bounds_of_triangle(const Corners& corners) {
  Aabb box;
  for (const glm::vec3& p : corners) box = merged(box, {p, p});
  return box;
}

// Side k of a triangle goes from corner k to corner k + 1.
struct Side {
  std::uint64_t places = 0;  // numbers of both ends, the lower first
  std::uint32_t triangle = 0;
  std::uint8_t side = 0;
  bool forward = false;  // from the lower place to the higher
};

struct Candidate {
  double growth = 0;
  Side first, second;
};

using Places = std::array<std::uint32_t, 3>;

std::vector<Side> sides_of(std::span<const Places> places) {
  std::vector<Side> sides;
  sides.reserve(places.size() * 3);
  for (std::uint32_t t = 0; t < places.size(); ++t) {
    for (std::uint8_t k = 0; k < 3; ++k) {
      const std::uint64_t a = places[t][k];
      const std::uint64_t b = places[t][(k + 1) % 3];
      sides.push_back({std::min(a, b) << 32 | std::max(a, b), t, k, a < b});
    }
  }
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) {
    return a.places != b.places ? a.places < b.places : a.triangle < b.triangle;
  });
  return sides;
}

std::vector<Candidate> candidates_of(std::span<const Corners> corners,
                                     std::span<const Places> places) {
  std::vector<double> area(corners.size());
  for (std::size_t t = 0; t < corners.size(); ++t)
    area[t] = half_area(bounds_of_triangle(corners[t]));
  const std::vector<Side> sides = sides_of(places);
  std::vector<Candidate> candidates;
  candidates.reserve(corners.size() * 3 / 2);
  // Where more than two triangles meet in an edge, only neighbours in the list are tried.
  for (std::size_t i = 0; i + 1 < sides.size(); ++i) {
    const Side& a = sides[i];
    const Side& b = sides[i + 1];
    if (a.places != b.places || a.forward == b.forward || a.triangle == b.triangle) continue;
    const double both = half_area(
        merged(bounds_of_triangle(corners[a.triangle]), bounds_of_triangle(corners[b.triangle])));
    const double apart = area[a.triangle] + area[b.triangle];
    const double growth = apart > 0 ? both / apart : both > 0 ? 2.0 : 0.5;
    if (growth <= most_growth) candidates.push_back({growth, a, b});
  }
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    if (a.growth != b.growth) return a.growth < b.growth;
    if (a.first.triangle != b.first.triangle) return a.first.triangle < b.first.triangle;
    return a.first.side < b.first.side;
  });
  return candidates;
}

// Extends `box` by the part of a triangle that lies on one side of a plane, a convex polygon.
void add_clipped(const Corners& corners, int axis, float position, bool keep_low, Aabb& box) {
  for (int i = 0; i < 3; ++i) {
    const glm::vec3& a = corners[i];
    const glm::vec3& b = corners[(i + 1) % 3];
    if (keep_low ? a[axis] <= position : a[axis] >= position) box = merged(box, {a, a});
    if ((a[axis] < position && b[axis] > position) || (a[axis] > position && b[axis] < position)) {
      const double s = (static_cast<double>(position) - a[axis]) /
                       (static_cast<double>(b[axis]) - static_cast<double>(a[axis]));
      const glm::dvec3 at = glm::dvec3(a) + s * (glm::dvec3(b) - glm::dvec3(a));
      glm::vec3 low, high;
      for (int k = 0; k < 3; ++k) {
        const auto nearest = static_cast<float>(at[k]);
        low[k] = std::nextafter(nearest, -std::numeric_limits<float>::infinity());
        high[k] = std::nextafter(nearest, std::numeric_limits<float>::infinity());
      }
      low[axis] = high[axis] = position;
      box = merged(box, {low, high});
    }
  }
}

Aabb clipped(const TrianglePair& pair, const Aabb& bounds, int axis, float position,
             bool keep_low) {
  const auto& v = pair.vertices;
  Aabb box;
  add_clipped({v[0], v[1], v[2]}, axis, position, keep_low, box);
  if (v[3] != v[2]) add_clipped({v[0], v[2], v[3]}, axis, position, keep_low, box);
  return {glm::max(box.low, bounds.low), glm::min(box.high, bounds.high)};
}

}  // namespace

Aabb bounds_of(const TrianglePair& pair) {
  Aabb box;
  for (const glm::vec3& v : pair.vertices) box = merged(box, {v, v});
  return box;
}

void split_pair(const TrianglePair& pair, const Aabb& bounds, int axis, float position, Aabb& left,
                Aabb& right) {
  left = clipped(pair, bounds, axis, position, true);
  right = clipped(pair, bounds, axis, position, false);
}

std::vector<TrianglePair> make_pairs(std::span<const Corners> corners,
                                     std::span<const std::uint32_t> primitives,
                                     std::span<const std::array<std::uint32_t, 3>> places) {
  std::vector<std::array<std::uint32_t, 3>> by_position;
  if (places.empty()) {
    by_position = places_of(corners);
    places = by_position;
  }
  std::vector<TrianglePair> pairs;
  pairs.reserve(corners.size());
  std::vector<bool> taken(corners.size(), false);
  for (const Candidate& candidate : candidates_of(corners, places)) {
    const auto [a, b] = std::pair(candidate.first, candidate.second);
    if (taken[a.triangle] || taken[b.triangle]) continue;
    taken[a.triangle] = taken[b.triangle] = true;
    // The shared side goes from v2 to v0 in the first triangle and from v0 to v2 in the second.
    const std::uint32_t rotation_a = (a.side + 1u) % 3u;
    const std::uint32_t rotation_b = b.side;
    const Corners& ca = corners[a.triangle];
    const Corners& cb = corners[b.triangle];
    pairs.push_back({{ca[rotation_a], ca[(rotation_a + 1) % 3], ca[(rotation_a + 2) % 3],
                      cb[(rotation_b + 2) % 3]},
                     {primitives[a.triangle], primitives[b.triangle]},
                     {rotation_a, rotation_b}});
  }
  for (std::size_t t = 0; t < corners.size(); ++t) {
    if (taken[t]) continue;
    pairs.push_back({{corners[t][0], corners[t][1], corners[t][2], corners[t][2]},
                     {primitives[t], primitives[t]},
                     {0, 0}});
  }
  return pairs;
}

Record pair_record(const TrianglePair& pair) {
  Record record{with_fill(pair.primitives[0], pair.rotations[0]),
                with_fill(pair.primitives[1], pair.rotations[1]), gpu::RECORD_PAIR, 0};
  for (std::size_t v = 0; v < 4; ++v)
    for (int axis = 0; axis < 3; ++axis)
      record[4 + 3 * v + static_cast<std::size_t>(axis)] =
          std::bit_cast<std::uint32_t>(pair.vertices[v][axis]);
  return record;
}

}  // namespace previz::scene
