#include "daemon/core/timing/path_timer.hpp"

#include <algorithm>
#include <chrono>
#include <utility>
#include <vector>

#include "daemon/core/pipeline/governor.hpp"
#include "daemon/core/pipeline/metrics.hpp"

namespace previz::timing {
namespace {

constexpr std::size_t timed_frames = 3;
// Once timed frames have taken so long together, no more are timed.
constexpr double long_s = 0.5;
constexpr double small_scale = 0.25;  // PathCost's small frames

set::Set with_settings(set::Set set, const FrameSettings& settings) {
  set.estimation = settings.estimation;
  set.lighting = settings.lighting;
  set.quality.adaptive = false;
  set.quality.error = set.quality.seconds = 0;
  return set;
}

ObserverCalibration with_lens(ObserverCalibration calibration, const FrameSettings& settings) {
  calibration.lens = settings.lens;
  return calibration;
}

pipeline::RenderStageOptions live_options(bool is_live) {
  pipeline::RenderStageOptions options;
  options.is_live = is_live;
  return options;
}

}  // namespace

PathTimer::PathTimer(const std::shared_ptr<render::Device>& device, TimedFrame& frame,
                     const scene::Scene& scene, const FrameSettings& settings, bool is_live)
    : shot_(frame.shot(settings.lighting, scene)),
      quality_(with_settings(frame.set(), settings).quality),
      stage_(device, with_settings(frame.set(), settings), with_lens(frame.calibration(), settings),
             scene, live_options(is_live)) {}

double PathTimer::time_of_a_frame() {
  pipeline::Shot shot = shot_;
  const auto start = std::chrono::steady_clock::now();
  stage_(shot);
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double PathTimer::time(const Making& making, bool layers) {
  set::Quality quality = quality_;
  quality.denoise = making.denoise;
  quality.samples = 1;
  stage_.use(quality);
  stage_.resize(making.scale);
  stage_.fill_layers(layers);
  time_of_a_frame();
  quality.samples = making.samples;
  stage_.use(quality);
  std::vector<double> times;
  double sum = 0;
  while (times.size() < timed_frames && sum < long_s) sum += times.emplace_back(time_of_a_frame());
  return pipeline::quantile(std::move(times), 0.5);
}

double PathTimer::live(const Making& making) {
  return time(making, false);
}

double PathTimer::offline(const Making& making) {
  return time(making, true);
}

PathCost::Small PathCost::measure_small(const std::function<double(const Making&)>& time) {
  constexpr int few = 4;
  const double one = time({1, small_scale, false}), more = time({few, small_scale, false});
  Small small;
  small.per_sample = std::max((more - one) / (few - 1), 1e-7);
  small.fixed = std::max(one - small.per_sample, 1e-7);
  small.denoise = std::max(time({1, small_scale, true}) - one, 0.0);
  return small;
}

PathCost::PathCost(PathTimer& timer, bool is_live, double limit_s) {
  const auto time = [&](const Making& making) {
    return is_live ? timer.live(making) : timer.offline(making);
  };
  small_ = measure_small(time);
  if (is_live)
    measure_live(time, limit_s);
  else
    measure_whole(time);
}

// The sizes say what is scaled with the pixels, beside the making of a smaller plate.
void PathCost::measure_live(const std::function<double(const Making&)>& time, double limit_s) {
  constexpr double pixels = small_scale * small_scale;
  per_sample_ = small_.per_sample / pixels;
  denoise_ = small_.denoise / pixels;
  const double half = time({1, 0.5, false}) - per_sample_ / 4;
  per_pixels_ = std::max((half - small_.fixed) / (1.0 / 4 - pixels), 0.0);
  fixed_ = std::max(small_.fixed - per_pixels_ * pixels, 0.0);
  whole_ = fixed_ + per_pixels_;
  if (seconds({1, 1, false}) > limit_s) return;
  measure_whole(time);
}

void PathCost::measure_whole(const std::function<double(const Making&)>& time) {
  constexpr int few = 4;
  const double one = time({1, 1, false});
  per_sample_ = std::max((time({few, 1, false}) - one) / (few - 1), 1e-6);
  whole_ = std::max(one - per_sample_, 0.0);
  denoise_ = std::max(time({1, 1, true}) - one, 0.0);
}

PathCost::PathCost(PathTimer& timer, bool is_live, const PathCost& like) : PathCost(like) {
  small_ = measure_small(
      [&](const Making& making) { return is_live ? timer.live(making) : timer.offline(making); });
  per_sample_ *= small_.per_sample / like.small_.per_sample;
  const double fixed = small_.fixed / like.small_.fixed;
  whole_ *= fixed;
  fixed_ *= fixed;
  per_pixels_ *= fixed;
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

}  // namespace previz::timing
