#include "daemon/tools/trade/measure.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

namespace previz::trade {
namespace {

constexpr std::size_t block_px = 8;
// An error counts as measured if the reference's own error is at most this part of it.
constexpr double allowed_noise = 0.1;

// Sums of squares over pixels and channels.
struct Squares {
  double error = 0, signal = 0;
  void add(const glm::vec3& wrong, const glm::vec3& right) {
    const glm::dvec3 e = glm::dvec3(wrong) - glm::dvec3(right);
    error += glm::dot(e, e);
    signal += glm::dot(glm::dvec3(right), glm::dvec3(right));
  }
  std::optional<double> relative() const {
    if (!(signal > 0)) return std::nullopt;
    return std::sqrt(error / signal);
  }
};

std::vector<glm::vec3> middle(const std::vector<glm::vec3>& a, const std::vector<glm::vec3>& b) {
  std::vector<glm::vec3> mean(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) mean[i] = 0.5f * (a[i] + b[i]);
  return mean;
}

TradePicture middle(const TradePicture& a, const TradePicture& b) {
  TradePicture mean{a.width, a.height, middle(a.shown, b.shown), middle(a.added, b.added), a.mask};
  for (std::size_t i = 0; i < mean.mask.size(); ++i) mean.mask[i] = 0.5f * (a.mask[i] + b.mask[i]);
  return mean;
}

// Products of one pixel's differences from the set's own picture, summed over its channels.
struct CommonDifference {
  double common = 0;  // the mean of d e over all pairs of differences
  // A sample of d e if d and e were only noise. Both factors are linear combinations of the first
  // three differences in which the signal cancels; each has the variance of one difference, and
  // they are uncorrelated.
  double noise = 0;
};

// The squared difference of two pictures over the square of `signal`, with the deviation of its
// sums over blocks.
SquaredError squared_difference(const TradePicture& a, const TradePicture& b,
                                const TradePicture& signal) {
  const auto width = static_cast<std::size_t>(a.width), height = static_cast<std::size_t>(a.height);
  const std::size_t columns = (width + block_px - 1) / block_px;
  std::vector<double> blocks(columns * ((height + block_px - 1) / block_px));
  double sum = 0, of_signal = 0;
  for (std::size_t i = 0; i < a.shown.size(); ++i) {
    const glm::dvec3 d = glm::dvec3(a.shown[i]) - glm::dvec3(b.shown[i]);
    blocks[i / width / block_px * columns + i % width / block_px] += glm::dot(d, d);
    sum += glm::dot(d, d);
    of_signal += glm::dot(glm::dvec3(signal.shown[i]), glm::dvec3(signal.shown[i]));
  }
  if (!(of_signal > 0)) return {};
  const double mean = sum / static_cast<double>(blocks.size());
  double spread = 0;
  for (const double block : blocks) spread += (block - mean) * (block - mean);
  return {sum / of_signal, std::sqrt(spread) / of_signal};
}

CommonDifference common_difference(std::span<const TradePicture> alike,
                                   std::span<const TradePicture> own, std::size_t i) {
  const auto difference = [&](std::size_t k) {
    return glm::dvec3(alike[k].shown[i]) - glm::dvec3(own[k].shown[i]);
  };
  glm::dvec3 sum(0);
  double squares = 0;
  for (std::size_t k = 0; k < alike.size(); ++k) {
    const glm::dvec3 d = difference(k);
    sum += d;
    squares += glm::dot(d, d);
  }
  const auto count = static_cast<double>(alike.size());
  const glm::dvec3 x = difference(0), y = difference(1), z = difference(2);
  return {(glm::dot(sum, sum) - squares) / (count * (count - 1)),
          glm::dot(x - y, x + y - 2.0 * z) / std::sqrt(12.0)};
}

}  // namespace

TradePicture trade_picture(const render::Layers& layers, const render::PlateRadiance& camera,
                           double white) {
  TradePicture picture{
      layers.width, layers.height, {}, {}, {layers.mask.begin(), layers.mask.end()}};
  picture.shown.reserve(layers.composite.size());
  picture.added.reserve(layers.composite.size());
  for (std::size_t i = 0; i < layers.composite.size(); ++i) {
    const glm::dvec3 seen(camera.channel(i, 0).radiance, camera.channel(i, 1).radiance,
                          camera.channel(i, 2).radiance);
    const glm::dvec3 shown = glm::clamp(glm::dvec3(layers.composite[i]), 0.0, white);
    picture.shown.emplace_back(shown);
    // An untouched pixel adds exactly nothing, whatever rounding did to the camera's value.
    const bool same = glm::vec3(seen) == layers.composite[i];
    picture.added.emplace_back(same ? glm::dvec3(0) : shown - seen);
  }
  return picture;
}

// In expectation the mean of the halves is as far from the truth as from either half.
TradeReference::TradeReference(const TradePicture& a, const TradePicture& b)
    : mean_(middle(a, b)), second_(b), noise_(errors(a)) {
  own_ = squared_difference(a, mean_, mean_);
}

SquaredError TradeReference::squared_error(const TradePicture& picture) const {
  const SquaredError seen = squared_difference(picture, mean_, mean_);
  return {seen.value - own_.value, std::hypot(seen.deviation, own_.deviation)};
}

// A half has twice the variance of the mean.
SquaredError TradeReference::squared_error_by_second_half(const TradePicture& picture) const {
  const SquaredError seen = squared_difference(picture, second_, mean_);
  return {seen.value - 2 * own_.value, std::hypot(seen.deviation, 2 * own_.deviation)};
}

TradeErrors TradeReference::errors(const TradePicture& picture) const {
  assert(picture.shown.size() == mean_.shown.size());
  Squares uncovered, covered, all;
  for (std::size_t i = 0; i < mean_.shown.size(); ++i) {
    if (mean_.mask[i] == 0) uncovered.add(picture.added[i], mean_.added[i]);
    if (mean_.mask[i] == 1) covered.add(picture.shown[i], mean_.shown[i]);
    all.add(picture.shown[i], mean_.shown[i]);
  }
  return {uncovered.relative(), covered.relative(), all.relative()};
}

TradeReference::Bias TradeReference::bias(std::span<const TradePicture> alike,
                                          std::span<const TradePicture> own) const {
  assert(alike.size() >= 3 && own.size() == alike.size());
  const auto width = static_cast<std::size_t>(mean_.width);
  const auto height = static_cast<std::size_t>(mean_.height);
  const std::size_t columns = (width + block_px - 1) / block_px;
  // Noise is summed by blocks of 8x8 pixels, because pixels that share photons share their noise.
  std::vector<double> noise(columns * ((height + block_px - 1) / block_px));
  double common = 0, signal = 0;
  for (std::size_t i = 0; i < mean_.shown.size(); ++i) {
    const CommonDifference pixel = common_difference(alike, own, i);
    common += pixel.common;
    noise[i / width / block_px * columns + i % width / block_px] += pixel.noise;
    signal += glm::dot(glm::dvec3(mean_.shown[i]), glm::dvec3(mean_.shown[i]));
  }
  if (!(signal > 0)) return {};
  double variance = 0;  // variance of one pair's sum; the sums of different pairs are uncorrelated
  for (const double block : noise) variance += block * block;
  const auto pairs = static_cast<double>(alike.size() * (alike.size() - 1)) / 2;
  const double three_errors = 3 * std::sqrt(variance / pairs);
  Bias bias;
  bias.least = std::sqrt(three_errors / signal);
  if (common > three_errors) bias.value = std::sqrt(common / signal);
  return bias;
}

double error_of(const SquaredError& squared) {
  return std::sqrt(std::max(squared.value, 0.0));
}

double deviation_of(const SquaredError& squared) {
  const auto root = [](double value) { return std::sqrt(std::max(value, 0.0)); };
  return 0.5 * (root(squared.value + squared.deviation) - root(squared.value - squared.deviation));
}

SquaredError mean(std::span<const SquaredError> squared) {
  assert(!squared.empty());
  SquaredError sum;
  for (const SquaredError& one : squared) {
    sum.value += one.value;
    sum.deviation = std::hypot(sum.deviation, one.deviation);
  }
  const auto count = static_cast<double>(squared.size());
  return {sum.value / count, sum.deviation / count};
}

TradeErrors rms(std::span<const TradeErrors> errors) {
  assert(!errors.empty());
  const auto of = [&](std::optional<double> TradeErrors::*measure) -> std::optional<double> {
    double sum = 0;
    for (const TradeErrors& one : errors) {
      if (!(one.*measure)) return std::nullopt;
      sum += *(one.*measure) * *(one.*measure);
    }
    return std::sqrt(sum / static_cast<double>(errors.size()));
  };
  return {of(&TradeErrors::difference), of(&TradeErrors::virtual_part), of(&TradeErrors::picture)};
}

std::string within_noise(const TradeErrors& errors, const TradeErrors& noise) {
  std::string names;
  const auto check = [&](const char* name, std::optional<double> TradeErrors::*measure) {
    const auto &error = errors.*measure, &own = noise.*measure;
    if (!error || !own || *own <= allowed_noise * *error) return;
    if (!names.empty()) names += ' ';
    names += name;
  };
  check("e_diff", &TradeErrors::difference);
  check("e_virtual", &TradeErrors::virtual_part);
  check("e_picture", &TradeErrors::picture);
  return names;
}

std::vector<bool> pareto_front(std::span<const TradeCost> costs) {
  std::vector<bool> front;
  for (const TradeCost& one : costs) {
    front.push_back(std::ranges::none_of(costs, [&](const TradeCost& other) {
      return other.seconds <= one.seconds && other.error <= one.error &&
             (other.seconds < one.seconds || other.error < one.error);
    }));
  }
  return front;
}

std::size_t knee(std::span<const TradeCost> front) {
  assert(!front.empty());
  const auto share = [](double value, double from, double to) {
    return to > from ? std::log(value / from) / std::log(to / from) : 0;
  };
  std::size_t best = 0;
  double deepest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i + 1 < front.size(); ++i) {
    const double x = share(front[i].seconds, front.front().seconds, front.back().seconds);
    const double y = share(front[i].error, front.back().error, front.front().error);
    if (1 - x - y > deepest) {
      deepest = 1 - x - y;
      best = i;
    }
  }
  return best;
}

}  // namespace previz::trade
