#include "daemon/trade/probes.hpp"

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

Probes::Known& Probes::known(const TradeSettings& settings, int samples) {
  for (Known& known : known_)
    if (known.samples == samples && known.settings == settings) return known;
  return known_.emplace_back(Known{settings, samples, {}});
}

void Probes::know_error(const TradeSettings& settings, int samples, const SquaredError& squared) {
  known(settings, samples).rounds.push_back(squared);
}

SquaredError Probes::measure(const TradeSettings& settings, int samples, int round) {
  stop_if_over();
  if (!probing_ || !(probed_ == settings)) {
    probing_.emplace(parts_.device, parts_.frame, parts_.scene, settings, parts_.scale);
    probed_ = settings;
  }
  probing_->begin(parts_.seed(round));
  probing_->render(samples);
  const TradePicture& like = reference_->picture();
  return reference_->squared_error(enlarged(probing_->picture(), like.width, like.height));
}

SquaredError Probes::error(const TradeSettings& settings, const Making& making, bool stated) {
  TradeSettings probed = settings;
  probed.scale = making.scale;
  probed.denoise = making.denoise;
  probed.adaptive = false;
  const auto wanted = static_cast<std::size_t>(stated ? parts_.rounds : 1);
  while (known(probed, making.samples).rounds.size() < wanted) {
    const auto done = static_cast<int>(known(probed, making.samples).rounds.size());
    try {
      const SquaredError squared = measure(probed, making.samples, done);
      known(probed, making.samples).rounds.push_back(squared);
    } catch (const OutOfTime&) {
      if (done == 0) throw;
      break;  // the rounds that there are
    }
  }
  return mean(known(probed, making.samples).rounds);
}

StillCurves Probes::curves(const TradeSettings& settings, double wanted) {
  TradeSettings probed = settings;
  probed.adaptive = false;
  if (probed == own_ || settings == own_) return of_own_;
  for (const auto& [known, curves] : curves_)
    if (known == probed) return curves;
  return curves_.emplace_back(probed, measure_curves(probed, wanted)).second;
}

StillCurves Probes::measure_curves(const TradeSettings& settings, double wanted) {
  stop_if_over();
  probing_.reset();
  MethodRenderer renderer(parts_.device, parts_.frame, parts_.scene, settings, parts_.scale);
  renderer.begin(parts_.seed(0));
  StillCurves curves;
  const int most = of_own_.noisy.empty() ? most_curve_samples
                                         : static_cast<int>(of_own_.noisy.points().back().samples);
  for (int samples = 1; samples <= most; samples *= 2) {
    if (samples > least_curve_samples && is_over()) break;
    if (parts_.stop.stop_requested()) throw Stopped();
    renderer.add(samples - samples / 2);
    curves.noisy.add(samples, reference_->squared_error(renderer.picture()));
    curves.denoised.add(samples, reference_->squared_error(renderer.denoised_picture()));
    if (error_of(curves.noisy.points().back().squared) <= wanted) break;
  }
  curves.noisy.extend(of_own_.noisy);
  curves.denoised.extend(of_own_.denoised);
  return curves;
}

PathCost Probes::cost(const TradeSettings& settings, bool is_live) {
  for (const KnownCost& known : costs_)
    if (known.is_live == is_live && known.settings == settings) return known.cost;
  stop_if_over();
  const auto own = std::ranges::find_if(costs_, [&](const KnownCost& known) {
    return known.is_live == is_live && known.settings == own_;
  });
  PathTimer timer(parts_.device, parts_.frame, parts_.scene, settings);
  costs_.push_back({settings, is_live,
                    own == costs_.end() ? PathCost(timer, is_live, parts_.live_limit_s)
                                        : PathCost(timer, is_live, own->cost)});
  return costs_.back().cost;
}

}  // namespace previz::trade
