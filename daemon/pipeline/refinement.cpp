#include "daemon/pipeline/refinement.hpp"

#include <algorithm>
#include <chrono>

#include "daemon/render/error_estimate.hpp"

namespace previz::pipeline {
namespace {

// Often enough for a progress line and a clock, seldom enough to cost nothing.
constexpr int batches_a_round = 32;
// Fewer samples do not know their own spread.
constexpr int least_samples = 8;
constexpr int most_samples = 1 << 24;

}  // namespace

Refined refine(render::Renderer& renderer, const set::Quality& quality,
               const std::function<bool()>& cancelled,
               const std::function<void(int samples)>& progress) {
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  const auto late = [&] {
    return quality.seconds > 0 &&
           std::chrono::duration<double>(Clock::now() - begin).count() >= quality.seconds;
  };
  Refined refined;
  const auto add = [&](int samples) {
    const int batch = std::max(1, samples / batches_a_round);
    for (int done = 0; done < samples && !late();) {
      const int now = std::min(batch, samples - done);
      renderer.render(now, cancelled);
      if (cancelled && cancelled()) return false;
      done += now;
      refined.samples += now;
      if (progress) progress(refined.samples);
    }
    return true;
  };
  const bool has_target = quality.error > 0 || quality.seconds > 0;
  int samples = has_target ? std::max(quality.samples, least_samples) : quality.samples;
  while (add(samples)) {
    if (!has_target) {
      refined.whole = true;
      break;
    }
    const render::Layers layers = renderer.layers();
    const render::ErrorEstimate estimate = render::estimate_error(layers);
    refined.error = estimate.picture;
    const double allowed = quality.error > 0 ? quality.error : 0.5 * estimate.picture;
    const auto blocks = render::blocks_above(estimate, layers.width, layers.height, allowed);
    const bool converged = std::find(blocks.begin(), blocks.end(), 1u) == blocks.end();
    if (converged || late() || refined.samples >= most_samples) {
      refined.whole = true;
      break;
    }
    renderer.sample_only(blocks);
    samples = refined.samples;
  }
  return refined;
}

}  // namespace previz::pipeline
