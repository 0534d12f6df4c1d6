#include "daemon/core/pipeline/refinement.hpp"

#include <algorithm>
#include <cassert>
#include <chrono>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "daemon/core/render/picture/error_estimate.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::pipeline {
namespace {

// A round is cut into this many batches: enough for a progress line and a time limit, few enough to
// cost nothing.
constexpr int batches_a_round = 32;
// The spread of fewer samples cannot be estimated.
constexpr int least_samples = 8;
constexpr int most_samples = 1 << 24;
// One sample in this many is a pilot sample, which decides where the others are needed.
constexpr int pilot_share = 16;
// With fewer samples too large a share of them would be pilot samples.
constexpr int least_adaptive_samples = 32;

bool goes_on(const set::Quality& quality) {
  return quality.error > 0 || quality.seconds > 0;
}

std::vector<std::uint32_t> limits_of(const std::vector<bool>& active, int samples) {
  std::vector<std::uint32_t> limits;
  for (const bool more : active)
    limits.push_back(more ? gpu::UNLIMITED : static_cast<std::uint32_t>(samples));
  return limits;
}

// Renders `samples` a pixel on average, spent where they help most. The pilot samples only decide
// where the others go. They are left out of the picture, because it would be biased by what they
// have missed.
Refined spread(render::Renderer& renderer, int samples, const std::function<bool()>& cancelled,
               const std::function<void(int samples)>& progress) {
  Refined refined;
  const int pilot_samples = std::max(least_samples, samples / pilot_share);
  const std::optional<render::Layers> pilot = renderer.pilot(pilot_samples, cancelled);
  if (!pilot) return refined;
  const std::vector<std::uint32_t> limits = render::spread_samples(
      render::estimate_error(*pilot), pilot->width, pilot->height, samples - pilot_samples);
  renderer.limit_samples(limits);

  const std::uint32_t most = *std::ranges::max_element(limits);
  const std::uint32_t batch = std::max(1u, most / batches_a_round);
  for (std::uint32_t done = 0; done < most;) {
    const std::uint32_t now = std::min(batch, most - done);
    renderer.render(static_cast<int>(now), cancelled);
    if (cancelled && cancelled()) return refined;
    done += now;
    double spent = 0;
    for (const std::uint32_t limit : limits) spent += std::min(limit, done);
    const double mean = pilot_samples + spent / static_cast<double>(limits.size());
    if (progress) progress(static_cast<int>(std::lround(mean)));
  }
  refined.samples = static_cast<int>(most);
  refined.whole = true;
  return refined;
}

}  // namespace

bool spreads_samples(const set::Quality& quality) {
  return quality.adaptive && !goes_on(quality) && quality.samples >= least_adaptive_samples;
}

bool has_fixed_samples(const set::Quality& quality) {
  return !goes_on(quality) && !spreads_samples(quality);
}

Refined render_range(render::Renderer& renderer, int samples, render::SampleRange range,
                     const std::function<bool()>& cancelled,
                     const std::function<void(int samples)>& progress) {
  Refined refined;
  const render::SampleSpan own = render::samples_of(range, samples);
  const int all_parts = render::part_count(samples), parts = all_parts / range.count;
  assert(parts > 0 && parts * range.count == all_parts);
  const int batch = std::max(1, own.count / batches_a_round);
  renderer.start_at(own.first);
  render::SumTree tree;
  for (int part = 0; part < parts; ++part) {
    const int count =
        render::samples_of({parts * (range.index - 1) + part + 1, all_parts}, samples).count;
    for (int done = 0; done < count;) {
      const int now = std::min(batch, count - done);
      renderer.render(now, cancelled);
      if (cancelled && cancelled()) return refined;
      done += now;
      refined.samples += now;
      if (progress) progress(refined.samples);
    }
    if (parts > 1) tree.add(renderer.take_sums());
  }
  if (parts > 1) renderer.put_sums(tree.take());
  refined.whole = true;
  return refined;
}

Refined refine(render::Renderer& renderer, const set::Quality& quality,
               const std::function<bool()>& cancelled,
               const std::function<void(int samples)>& progress) {
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  const auto late = [&] {
    return quality.seconds > 0 &&
           std::chrono::duration<double>(Clock::now() - begin).count() >= quality.seconds;
  };
  if (spreads_samples(quality)) return spread(renderer, quality.samples, cancelled, progress);
  Refined refined;
  const auto add = [&](int samples) {
    const int batch = std::max(1, samples / batches_a_round);
    for (int done = 0; done < samples && !late();) {
      const int now = std::min(batch, samples - done);
      renderer.render(now, cancelled);
      if (quality.seconds > 0) renderer.wait();
      if (cancelled && cancelled()) return false;
      done += now;
      refined.samples += now;
      if (progress) progress(refined.samples);
    }
    return true;
  };
  const bool has_target = goes_on(quality);
  int samples = has_target ? std::max(quality.samples, least_samples) : quality.samples;
  if (has_target) renderer.separate_parts();
  std::vector<bool> active;                 // parts of blocks, which get the next samples
  std::vector<std::uint32_t> part_samples;  // that the pixels of each part have
  while (add(samples)) {
    if (!has_target) {
      refined.whole = true;
      break;
    }
    const render::Layers layers = renderer.layers();
    const render::ErrorEstimate estimate = render::estimate_error(layers);
    refined.error = estimate.picture;
    active.resize(estimate.parts.size(), true);
    part_samples.resize(active.size());
    for (std::size_t i = 0; i < active.size(); ++i)
      part_samples[i] += active[i] ? static_cast<std::uint32_t>(samples) : 0;
    const double allowed = quality.error > 0 ? quality.error : 0.5 * estimate.picture;
    // What has ended does not begin again: otherwise the light that a part has met would bring the
    // others samples, and the light that these meet would bring it some, to its own dilution. Only
    // where time alone counts, what falls behind the rest begins again, when all have ended.
    const auto above =
        render::parts_above(estimate, layers.width, layers.height, allowed, part_samples);
    const std::vector<bool> before = std::exchange(active, above);
    for (std::size_t i = 0; i < active.size(); ++i) active[i] = above[i] && before[i];
    if (quality.error <= 0 && std::ranges::find(active, true) == active.end()) active = above;
    const bool converged = std::ranges::find(active, true) == active.end();
    if (converged || late() || refined.samples >= most_samples) {
      refined.whole = true;
      break;
    }
    renderer.limit_parts(limits_of(active, refined.samples));
    samples = refined.samples;
  }
  return refined;
}

}  // namespace previz::pipeline
