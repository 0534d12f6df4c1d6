#include "daemon/core/tracking/search_plan.hpp"

#include <algorithm>
#include <cmath>

namespace previz::tracking {
namespace {

constexpr int kStrips = sweep_pictures - 1;
// A tag of 64 px in the middle of a strip's border, and what libapriltag needs about it.
constexpr double kStripOverlapPx = 64.0 / 2 + 12;
// libapriltag thresholds in tiles of this side; regions on this grid are thresholded as the whole
// picture is.
constexpr int kTilePx = 4;

bool meet(const Region& a, const Region& b) {
  return a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;
}

Region around_both(const Region& a, const Region& b) {
  const int x = std::min(a.x, b.x), y = std::min(a.y, b.y);
  return {x, y, std::max(a.x + a.width, b.x + b.width) - x,
          std::max(a.y + a.height, b.y + b.height) - y};
}

// Adds a region; those that it meets become one with it.
void add_apart(std::vector<Region>& regions, Region region) {
  for (std::size_t i = 0; i < regions.size();) {
    if (!meet(regions[i], region)) {
      ++i;
      continue;
    }
    region = around_both(regions[i], region);
    regions.erase(regions.begin() + static_cast<std::ptrdiff_t>(i));
    i = 0;
  }
  regions.push_back(region);
}

}  // namespace

SearchStep SearchPlan::next(const std::vector<ExpectedTag>& expected) {
  SearchStep step;
  for (const ExpectedTag& tag : expected) add_apart(step.regions, around(tag.low, tag.high));
  if (swept_ < kStrips) {
    const double strip = static_cast<double>(height_) / kStrips;
    step.regions.push_back(around({0, swept_ * strip - kStripOverlapPx},
                                  {width_, (swept_ + 1) * strip + kStripOverlapPx}));
  }
  step.coarse = swept_ == kStrips;
  swept_ = (swept_ + 1) % sweep_pictures;
  ++since_whole_;
  return step;
}

Region SearchPlan::around(glm::dvec2 low, glm::dvec2 high) const {
  const auto down = [](double at, int most) {
    return static_cast<int>(std::clamp(std::floor(at), 0.0, 1.0 * most)) / kTilePx * kTilePx;
  };
  const auto up = [](double at, int most) {
    const int whole = static_cast<int>(std::clamp(std::ceil(at) + 1, 0.0, 1.0 * most));
    return std::min(most, (whole + kTilePx - 1) / kTilePx * kTilePx);
  };
  const int x = down(low.x, width_ - 1), y = down(low.y, height_ - 1);
  return {x, y, std::max(1, up(high.x, width_) - x), std::max(1, up(high.y, height_) - y)};
}

}  // namespace previz::tracking
