#include "daemon/core/render/picture/sample_sums.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

#include "daemon/core/render/picture/each_pixel.hpp"
#include "drivers/error.hpp"

namespace previz::render {
namespace {

constexpr int least_part_samples = 64;
constexpr int most_parts = 16;

// The sum of two floats, rounded, and what rounding took from it.
struct TwoFloats {
  float high, low;
};

TwoFloats two_sum(float a, float b) {
  const float sum = a + b;
  const float of_b = sum - a;
  return {sum, (a - (sum - of_b)) + (b - of_b)};
}

// |a| >= |b|, or a is 0.
TwoFloats fast_two_sum(float a, float b) {
  const float sum = a + b;
  return {sum, b - (sum - a)};
}

void add_two_floats(float& high, float& low, float more_high, float more_low) {
  const TwoFloats s = two_sum(high, more_high);
  const TwoFloats t = two_sum(low, more_low);
  const TwoFloats v = fast_two_sum(s.high, s.low + t.high);
  const TwoFloats z = fast_two_sum(v.high, t.low + v.low);
  high = z.high;
  low = z.low;
}

void add_two_floats(glm::vec4& high, glm::vec4& low, const glm::vec4& more_high,
                    const glm::vec4& more_low) {
  for (int c = 0; c < 4; ++c) add_two_floats(high[c], low[c], more_high[c], more_low[c]);
}

void add_to(gpu::GpuPixel& sums, const gpu::GpuPixel& more) {
  add_two_floats(sums.mixed_high, sums.mixed_low, more.mixed_high, more.mixed_low);
  add_two_floats(sums.diff_high, sums.diff_low, more.diff_high, more.diff_low);
  add_two_floats(sums.uncovered_high, sums.uncovered_low, more.uncovered_high, more.uncovered_low);
  add_two_floats(sums.square_high, sums.square_low, more.square_high, more.square_low);
  sums.normal += more.normal;
  sums.albedo += more.albedo;
}

}  // namespace

std::string to_string(SampleRange range) {
  return std::to_string(range.index) + "/" + std::to_string(range.count);
}

int part_count(int samples) {
  int parts = 1;
  while (parts < most_parts && samples / (2 * parts) >= least_part_samples) parts *= 2;
  return parts;
}

SampleSpan samples_of(SampleRange range, int samples) {
  const auto start = [&](int index) {
    return static_cast<int>(std::int64_t{samples} * index / range.count);
  };
  const int first = start(range.index - 1);
  return {first, start(range.index) - first};
}

void add_samples_counted(Counters& counters, const Counters& more) {
  counters.rays += more.rays;
  counters.shadow_rays += more.shadow_rays;
  counters.dropped_not_finite += more.dropped_not_finite;
  counters.dropped_negative += more.dropped_negative;
  counters.stopped_in_layers += more.stopped_in_layers;
  counters.unfinished += more.unfinished;
  counters.measured += more.measured;
  counters.unmeasured += more.unmeasured;
}

void add_to(SampleSums& sums, const SampleSums& more) {
  assert(sums.width == more.width && sums.height == more.height);
  assert(sums.sums.pixels.size() == more.sums.pixels.size());
  assert(sums.sums.caustics.size() == more.sums.caustics.size());
  each_pixel(sums.sums.pixels.size(),
             [&](std::size_t i) { add_to(sums.sums.pixels[i], more.sums.pixels[i]); });
  each_pixel(sums.sums.caustics.size(),
             [&](std::size_t i) { sums.sums.caustics[i] += more.sums.caustics[i]; });
  sums.samples += more.samples;
  add_samples_counted(sums.counters, more.counters);
}

void refuse_unfit(const SampleSums& sums, const PinholeIntrinsics& lens, bool has_photons) {
  if (sums.width != lens.width || sums.height != lens.height)
    throw Error("renderer: the sums of a frame of " + std::to_string(sums.width) + "x" +
                std::to_string(sums.height) + " do not fit the calibration's " +
                std::to_string(lens.width) + "x" + std::to_string(lens.height));
  if (has_photons == sums.sums.caustics.empty())
    throw Error(std::string("renderer: the sums of a frame were made ") +
                (has_photons ? "without photons, which its scene needs"
                             : "with photons, which its scene does not need"));
}

void SumTree::add(SampleSums sums) {
  Node node{0, std::move(sums)};
  for (; !waiting_.empty() && waiting_.back().height == node.height; waiting_.pop_back()) {
    add_to(waiting_.back().sums, node.sums);
    node = {node.height + 1, std::move(waiting_.back().sums)};
  }
  waiting_.push_back(std::move(node));
}

SampleSums SumTree::take() {
  assert(waiting_.size() == 1);
  SampleSums sums = std::move(waiting_.back().sums);
  waiting_.clear();
  return sums;
}

}  // namespace previz::render
