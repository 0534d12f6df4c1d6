#include "daemon/trade/path_timer.hpp"

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "daemon/pipeline/governor.hpp"
#include "daemon/pipeline/metrics.hpp"

namespace previz::trade {
namespace {

constexpr int timed_frames = 3;

set::Set with_settings(set::Set set, const TradeSettings& settings) {
  set.estimation = settings.estimation;
  set.lighting = settings.lighting;
  set.quality.adaptive = false;
  set.quality.error = set.quality.seconds = 0;
  return set;
}

ObserverCalibration with_lens(ObserverCalibration calibration, const TradeSettings& settings) {
  calibration.lens = settings.lens;
  return calibration;
}

}  // namespace

PathTimer::PathTimer(const std::shared_ptr<render::Device>& device, TradeFrame& frame,
                     const scene::Scene& scene, const TradeSettings& settings)
    : shot_(frame.shot(settings.lighting, scene)),
      quality_(with_settings(frame.set(), settings).quality),
      stage_(device, with_settings(frame.set(), settings), with_lens(frame.calibration(), settings),
             scene, {}) {}

double PathTimer::time(const Making& making, bool layers) {
  set::Quality quality = quality_;
  quality.samples = making.samples;
  quality.denoise = making.denoise;
  stage_.use(quality);
  stage_.resize(making.scale);
  stage_.fill_layers(layers);
  std::vector<double> times;
  for (int i = 0; i <= timed_frames; ++i) {
    pipeline::Shot shot = shot_;
    const auto start = std::chrono::steady_clock::now();
    stage_(shot);
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    if (i > 0) times.push_back(took.count());
  }
  return pipeline::quantile(std::move(times), 0.5);
}

double PathTimer::live(const Making& making) {
  return time(making, false);
}

double PathTimer::offline(const Making& making) {
  return time(making, true);
}

PathCost::PathCost(PathTimer& timer, bool is_live) {
  const auto time = [&](const Making& making) {
    return is_live ? timer.live(making) : timer.offline(making);
  };
  const double one = time({1, 1, false}), four = time({4, 1, false});
  per_sample_ = std::max((four - one) / 3, 1e-6);
  whole_ = std::max(one - per_sample_, 0.0);
  denoise_ = std::max(time({1, 1, true}) - one, 0.0);
  if (!is_live) return;
  // Two smaller sizes say what is scaled with the pixels, beside the making of a smaller plate.
  const double half = time({1, 0.5, false}) - per_sample_ / 4;
  const double quarter = time({1, 0.25, false}) - per_sample_ / 16;
  per_pixels_ = std::max((half - quarter) / (1.0 / 4 - 1.0 / 16), 0.0);
  fixed_ = std::max(half - per_pixels_ / 4, 0.0);
}

double PathCost::seconds(const Making& making) const {
  const double pixels = making.scale * making.scale;
  const double fixed = making.scale < 1 ? fixed_ + per_pixels_ * pixels : whole_;
  return fixed + pixels * (per_sample_ * making.samples + (making.denoise ? denoise_ : 0));
}

int PathCost::samples_within(double limit, Making making) const {
  making.samples = 0;
  const double spare = limit - seconds(making);
  const double samples = spare / (per_sample_ * making.scale * making.scale);
  return static_cast<int>(std::clamp(samples, 0.0, double{pipeline::Governor::most_samples}));
}

}  // namespace previz::trade
