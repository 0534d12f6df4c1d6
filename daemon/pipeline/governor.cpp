#include "daemon/pipeline/governor.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>

namespace previz::pipeline {
namespace {

constexpr double step = std::numbers::sqrt2;  // factor on each side, for half or twice the pixels
constexpr double follow_down = 0.2;           // weight of a faster frame in the new cost

}  // namespace

Governor::Governor(double fps, double largest_scale)
    : budget_s_(headroom / fps), largest_scale_(largest_scale), scale_(largest_scale) {
  assert(fps > 0 && largest_scale > 0 && largest_scale <= 1);
}

double Governor::affordable(double scale) const {
  return budget_s_ / (cost_s_ * scale * scale);
}

void Governor::took(double seconds) {
  if (!(seconds > 0) || !std::isfinite(seconds)) return;
  const double cost = seconds / (samples_ * scale_ * scale_);
  cost_s_ = cost > cost_s_ ? cost : (1 - follow_down) * cost_s_ + follow_down * cost;
  ++at_this_scale_;

  const double before = scale_;
  while (affordable(scale_) < 1 && scale_ / step >= least_scale) scale_ /= step;
  const double larger = std::min(scale_ * step, largest_scale_);
  if (scale_ == before && scale_ < largest_scale_ && at_this_scale_ >= settle_frames &&
      affordable(larger) >= 2)
    scale_ = larger;
  if (scale_ != before) at_this_scale_ = 0;
  samples_ =
      static_cast<int>(std::clamp(std::floor(affordable(scale_)), 1.0, double{most_samples}));
}

}  // namespace previz::pipeline
