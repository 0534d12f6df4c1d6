#include "daemon/core/fit/feature_edges.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <optional>
#include <unordered_map>
#include <utility>

namespace previz::fit {
namespace {

constexpr double weld_m = 2e-5, cell_m = 10 * weld_m;
constexpr double cos_fold = 0.86602540378443865;      // of 30 degrees
constexpr double cos_straight = 0.99984769515639123;  // of 1 degree

// Gives corners numbers, the same to those that are within weld_m. The grid's cells are much wider,
// so that whatever is that near mostly lies in the same cell.
class Welder {
 public:
  std::uint32_t number_of(const glm::dvec3& p) {
    const Cell low = cell_of(p - weld_m), high = cell_of(p + weld_m);
    for (std::int64_t x = low[0]; x <= high[0]; ++x)
      for (std::int64_t y = low[1]; y <= high[1]; ++y)
        for (std::int64_t z = low[2]; z <= high[2]; ++z)
          if (const auto near = find(key({x, y, z}), p)) return *near;
    const auto number = static_cast<std::uint32_t>(places_.size());
    places_.push_back(p);
    cells_.emplace(key(cell_of(p)), number);
    return number;
  }

  const std::vector<glm::dvec3>& places() const { return places_; }

 private:
  using Cell = std::array<std::int64_t, 3>;

  static Cell cell_of(const glm::dvec3& p) {
    Cell cell{};
    for (int k = 0; k < 3; ++k) cell[std::size_t(k)] = std::int64_t(std::floor(p[k] / cell_m));
    return cell;
  }

  // Different cells may have one key: the distance decides.
  static std::uint64_t key(const Cell& cell) {
    return std::uint64_t(cell[0]) * 73856093u ^ std::uint64_t(cell[1]) * 19349663u ^
           std::uint64_t(cell[2]) * 83492791u;
  }

  std::optional<std::uint32_t> find(std::uint64_t key, const glm::dvec3& p) const {
    const auto [begin, end] = cells_.equal_range(key);
    for (auto at = begin; at != end; ++at)
      if (glm::distance(places_[at->second], p) <= weld_m) return at->second;
    return {};
  }

  std::vector<glm::dvec3> places_;
  std::unordered_multimap<std::uint64_t, std::uint32_t> cells_;
};

using Ends = std::pair<std::uint32_t, std::uint32_t>;  // the lower number first

// One side of a triangle.
struct Side {
  Ends ends;
  glm::dvec3 into{0};
  std::size_t part = no_part;
};

// Returns the sides of all triangles that have an area, sorted by their ends.
std::vector<Side> sides_of(const std::vector<glm::dvec3>& triangles,
                           const std::vector<std::size_t>& parts, Welder& welder) {
  std::vector<Side> sides;
  for (std::size_t t = 0; t + 2 < triangles.size(); t += 3) {
    std::array<std::uint32_t, 3> corner{};
    for (std::size_t k = 0; k < 3; ++k) corner[k] = welder.number_of(triangles[t + k]);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = corner[k], b = corner[(k + 1) % 3];
      if (a == b) continue;
      const glm::dvec3 &pa = welder.places()[a], &pb = welder.places()[b],
                       &pc = welder.places()[corner[(k + 2) % 3]];
      const glm::dvec3 along = glm::normalize(pb - pa);
      const glm::dvec3 across = pc - pa - glm::dot(pc - pa, along) * along;
      if (glm::length(across) > weld_m)
        sides.push_back({{std::min(a, b), std::max(a, b)},
                         glm::normalize(across),
                         parts.empty() ? no_part : parts[t / 3]});
    }
  }
  std::ranges::stable_sort(sides, {}, &Side::ends);
  return sides;
}

// An edge between two corners.
struct Stretch {
  Ends ends;
  std::vector<glm::dvec3> into;
  std::size_t part = no_part;
  bool is_used = false;
};

// A surface may have a copy for its back: directions that are the same count once.
std::vector<glm::dvec3> directions(const Side* side, const Side* end) {
  std::vector<glm::dvec3> different;
  for (; side != end; ++side)
    if (std::ranges::none_of(
            different, [&](const glm::dvec3& d) { return glm::dot(d, side->into) > cos_straight; }))
      different.push_back(side->into);
  return different;
}

std::size_t part_of(const Side* side, const Side* end) {
  const bool is_one =
      std::all_of(side, end, [side](const Side& other) { return other.part == side->part; });
  return is_one ? side->part : no_part;
}

bool is_feature(const std::vector<glm::dvec3>& into) {
  return into.size() != 2 || glm::dot(into[0], into[1]) > -cos_fold;
}

std::vector<Stretch> stretches_of(const std::vector<Side>& sides) {
  std::vector<Stretch> stretches;
  const Side* const end = sides.data() + sides.size();
  for (const Side* side = sides.data(); side != end;) {
    const Side* next = side;
    while (next != end && next->ends == side->ends) ++next;
    if (auto into = directions(side, next); is_feature(into))
      stretches.push_back({side->ends, std::move(into), part_of(side, next)});
    side = next;
  }
  return stretches;
}

class Joiner {
 public:
  Joiner(std::vector<Stretch> stretches, const std::vector<glm::dvec3>& places)
      : stretches_(std::move(stretches)), places_(places) {
    for (std::size_t i = 0; i < stretches_.size(); ++i) {
      at_.emplace(stretches_[i].ends.first, i);
      at_.emplace(stretches_[i].ends.second, i);
    }
  }

  std::vector<FeatureEdge> joined() {
    std::vector<FeatureEdge> edges;
    for (Stretch& stretch : stretches_) {
      if (std::exchange(stretch.is_used, true)) continue;
      const auto [a, b] = stretch.ends;
      const glm::dvec3 along = glm::normalize(places_[b] - places_[a]);
      edges.push_back({places_[last(a, -along, stretch.part)],
                       places_[last(b, along, stretch.part)], stretch.into, stretch.part});
    }
    return edges;
  }

 private:
  // Returns the corner at which a line ends that goes on from this one.
  std::uint32_t last(std::uint32_t corner, const glm::dvec3& along, std::size_t part) {
    while (const auto next = after(corner, along, part)) corner = *next;
    return corner;
  }

  std::optional<std::uint32_t> after(std::uint32_t corner, const glm::dvec3& along,
                                     std::size_t part) {
    const auto [begin, end] = at_.equal_range(corner);
    for (auto at = begin; at != end; ++at) {
      Stretch& stretch = stretches_[at->second];
      if (stretch.is_used || stretch.part != part) continue;
      const std::uint32_t other =
          stretch.ends.first == corner ? stretch.ends.second : stretch.ends.first;
      if (glm::dot(glm::normalize(places_[other] - places_[corner]), along) < cos_straight)
        continue;
      stretch.is_used = true;
      return other;
    }
    return {};
  }

  std::vector<Stretch> stretches_;
  const std::vector<glm::dvec3>& places_;
  std::unordered_multimap<std::uint32_t, std::size_t> at_;  // parts by their corners
};

}  // namespace

std::vector<FeatureEdge> feature_edges(const std::vector<glm::dvec3>& triangles,
                                       const std::vector<std::size_t>& parts) {
  Welder welder;
  std::vector<Stretch> stretches = stretches_of(sides_of(triangles, parts, welder));
  return Joiner(std::move(stretches), welder.places()).joined();
}

}  // namespace previz::fit
