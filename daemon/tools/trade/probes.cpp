#include "daemon/tools/trade/probes.hpp"

#include <algorithm>
#include <utility>

namespace previz::trade {
namespace {

// A curve of few samples says too little of what is rare.
constexpr int least_curve_samples = 16;
constexpr int most_curve_samples = 1 << 16;

}  // namespace

bool Probes::is_over() const {
  return phase_ && parts_.budget.is_over(*phase_, parts_.now_s());
}

void Probes::stop_if_over() const {
  if (parts_.stop.stop_requested()) throw Stopped();
  if (is_over()) throw OutOfTime();
}

SquaredError Probes::measure(const timing::FrameSettings& settings, int samples, int round) {
  stop_if_over();
  if (!probing_ || !(probed_ == settings)) {
    probing_.emplace(parts_.device, parts_.frame, parts_.scene, settings, parts_.scale);
    probed_ = settings;
  }
  probing_->begin(parts_.seed(round));
  probing_->render(samples);
  return reference_->squared_error(probing_->picture());
}

SquaredError Probes::error(const timing::FrameSettings& settings, const timing::Making& making,
                           bool stated) {
  timing::FrameSettings probed = settings;
  probed.scale = making.scale;
  probed.denoise = making.denoise;
  probed.adaptive = false;
  const auto wanted = static_cast<std::size_t>(stated ? parts_.rounds : 1);
  std::vector<SquaredError>& rounds = cache_.point(words(probed), making.samples).squared;
  while (rounds.size() < wanted) {
    try {
      rounds.push_back(measure(probed, making.samples, static_cast<int>(rounds.size())));
    } catch (const OutOfTime&) {
      if (rounds.empty()) throw;
      break;  // the rounds that there are
    }
  }
  return mean(rounds);
}

StillCurves Probes::curves(const timing::FrameSettings& settings, double wanted) {
  timing::FrameSettings probed = settings;
  probed.adaptive = false;
  if (probed == own_ || settings == own_) return cache_.reference.curves;
  const std::string name = words(probed);
  const auto known = std::ranges::find(cache_.curves, name, &KeptCurves::settings);
  StillCurves curves =
      known != cache_.curves.end() ? known->curves : measure_curves(probed, wanted);
  if (known == cache_.curves.end()) cache_.curves.push_back({name, curves});
  curves.noisy.extend(cache_.reference.curves.noisy);
  curves.denoised.extend(cache_.reference.curves.denoised);
  return curves;
}

StillCurves Probes::measure_curves(const timing::FrameSettings& settings, double wanted) {
  stop_if_over();
  probing_.reset();
  MethodRenderer renderer(parts_.device, parts_.frame, parts_.scene, settings, parts_.scale);
  renderer.begin(parts_.seed(0));
  StillCurves curves;
  const ErrorCurve& own = cache_.reference.curves.noisy;
  const int most = own.empty() ? most_curve_samples : static_cast<int>(own.points().back().samples);
  for (int samples = 1; samples <= most; samples *= 2) {
    if (samples > least_curve_samples && is_over()) break;
    if (parts_.stop.stop_requested()) throw Stopped();
    renderer.add(samples - samples / 2);
    curves.noisy.add(samples, reference_->squared_error(renderer.picture()));
    curves.denoised.add(samples, reference_->squared_error(renderer.denoised_picture()));
    if (error_of(curves.noisy.points().back().squared) <= wanted) break;
  }
  return curves;
}

timing::PathCost Probes::cost(const timing::FrameSettings& settings, bool is_live) {
  const auto known = [&](const timing::FrameSettings& wanted) -> const KeptCost* {
    const std::string name = words(wanted);
    for (const KeptCost& cost : cache_.costs)
      if (cost.is_live == is_live && cost.settings == name) return &cost;
    return nullptr;
  };
  if (const KeptCost* cost = known(settings)) return cost->cost;
  stop_if_over();
  timing::PathTimer timer(parts_.device, parts_.frame, parts_.scene, settings);
  const KeptCost* own = known(own_);
  const timing::PathCost cost = own ? timing::PathCost(timer, is_live, own->cost)
                                    : timing::PathCost(timer, is_live, parts_.live_limit_s);
  cache_.costs.push_back({words(settings), is_live, cost});
  return cost;
}

}  // namespace previz::trade
