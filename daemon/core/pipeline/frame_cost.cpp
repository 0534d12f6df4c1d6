#include "daemon/core/pipeline/frame_cost.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace previz::pipeline {
namespace {

// The random walk of a parameter, from frame to frame, over the frame's time. Slow drifts (a GPU
// that gets warm) are a few percent in a hundred frames.
constexpr double walk = 0.004;
// A frame is odd if it is further off than so many standard deviations.
constexpr double gate = 3;
constexpr double least_noise = 0.01, most_noise = 0.25;  // relative, of a frame
constexpr double noise_memory = 0.05;                    // weight of the newest frame
constexpr double least_time_s = 5e-5;  // below which no clock and no scheduler is regular
// The part of a frame's time that its samples take at least: zero would allow any number.
constexpr double least_share = 0.002;
constexpr int settles_in = 3;  // frames, before ratios are those of noise alone

}  // namespace

double FrameCost::variance(const Model& m, double work) {
  return std::max(m.fixed_variance + 2 * work * m.covariance + work * work * m.per_work_variance,
                  0.0);
}

double FrameCost::deviation(double work) const {
  return std::sqrt(variance(model_, work));
}

double FrameCost::share_unknown() const {
  return std::sqrt(model_.per_work_variance) / model_.per_work;
}

double FrameCost::noise(double expected) const {
  return relative_variance_ * expected * expected + least_time_s * least_time_s;
}

// The first frame says nothing about the parts: each is half of it, give or take as much.
void FrameCost::begin(double work, double seconds) {
  const double half = seconds / 2;
  model_ = {half,   half / work, half * half, half * half / (work * work), -half * half / work,
            seconds};
  model_.fixed_variance += noise(seconds);
}

FrameCost::Saw FrameCost::took(double work, double seconds) {
  assert(work > 0 && seconds > 0);
  if (!known()) {
    begin(work, seconds);
    return Saw::usual;
  }
  Saw saw = Saw::usual;
  if (before_) {
    const double old = before_->fixed + before_->per_work * work;
    const double old_error = std::abs(seconds - old);
    if (old_error < std::abs(seconds - this->seconds(work)) &&
        old_error <= gate * std::sqrt(variance(*before_, work) + noise(old))) {
      model_ = *before_;
      remember(odd_ratio_);
    } else {
      saw = Saw::changed;
    }
    before_.reset();
  }

  const double step = walk * this->seconds(work);
  model_.fixed_variance += step * step;
  const double slope_step = walk * std::max(model_.per_work, 0.1 * this->seconds(work) / work);
  model_.per_work_variance += slope_step * slope_step;
  const double expected = this->seconds(work), error = seconds - expected;
  const double deviation = std::sqrt(variance(model_, work) + noise(expected));
  if (std::abs(error) > gate * deviation) {
    if (error < 0 && !was_fast_) {
      was_fast_ = true;
      return Saw::odd;
    }
    if (error > 0) {
      before_ = model_;
      odd_ratio_ = seconds / expected;
    }
    if (saw == Saw::usual) saw = error < 0 ? Saw::changed : Saw::odd;
    settled_ = 0;
    was_fast_ = false;
    doubt(work, seconds);
  } else {
    was_fast_ = false;
    if (++settled_ > settles_in) remember(seconds / expected);
    const double beyond = error * error - variance(model_, work);
    const double relative = std::max(beyond, 0.0) / (expected * expected);
    relative_variance_ =
        std::clamp((1 - noise_memory) * relative_variance_ + noise_memory * relative,
                   least_noise * least_noise, most_noise * most_noise);
  }
  update(model_, work, seconds, noise(expected));
  if (saw == Saw::changed) {
    settled_ = 0;
    ratio_count_ = 0;  // those were of frames that cost something else
  }
  return saw;
}

// Makes the parts as uncertain as at the start, or as the frame says: each in proportion to what it
// costs, since most changes are of the whole scene, and to the surprise itself, since a part may be
// new.
void FrameCost::doubt(double work, double seconds) {
  const double surprise = std::abs(seconds - this->seconds(work));
  const double share = std::max(gate * surprise / this->seconds(work), 1.0);
  const auto widen = [&](double part) {
    return share * part * share * part + 0.25 * surprise * surprise;
  };
  model_.fixed_variance += widen(model_.fixed);
  model_.per_work_variance += widen(model_.per_work * work) / (work * work);
}

void FrameCost::update(Model& m, double work, double seconds, double noise) {
  const double error = seconds - (m.fixed + m.per_work * work);
  const double total = variance(m, work) + noise;
  const double for_fixed = m.fixed_variance + work * m.covariance;
  const double for_work = m.covariance + work * m.per_work_variance;
  m.fixed += for_fixed / total * error;
  m.per_work += for_work / total * error;
  m.fixed_variance -= for_fixed * for_fixed / total;
  m.per_work_variance -= for_work * for_work / total;
  m.covariance -= for_fixed * for_work / total;
  // Rounding must leave no variance below zero.
  m.fixed_variance = std::max(m.fixed_variance, least_time_s * least_time_s * 1e-6);
  m.per_work_variance =
      std::max(m.per_work_variance, least_time_s * least_time_s * 1e-6 / (work * work));
  // Neither part is negative. A parameter that is put at its bound takes the other one along, by
  // the regression of one on the other.
  const double least = least_share * seconds / work;
  if (m.fixed < 0) {
    m.per_work -= m.covariance / m.fixed_variance * m.fixed;
    m.fixed = 0;
  }
  if (m.per_work < least) {
    m.fixed = std::max(m.fixed + m.covariance / m.per_work_variance * (least - m.per_work), 0.0);
    m.per_work = least;
  }
  m.seconds = seconds;
}

void FrameCost::use_fixed(double seconds, double deviation, double work) {
  model_.fixed = seconds;
  model_.fixed_variance = deviation * deviation + work * work * model_.per_work_variance;
  model_.covariance = -work * model_.per_work_variance;
  before_.reset();
  was_fast_ = false;
  settled_ = 0;
}

void FrameCost::remember(double ratio) {
  ratios_[ratio_count_++ % ratios_.size()] = ratio;
}

std::optional<double> FrameCost::late_ratio() const {
  constexpr std::size_t fewest = 20;
  const std::size_t count = std::min(ratio_count_, ratios_.size());
  if (count < fewest) return std::nullopt;
  std::array<double, 128> sorted = ratios_;
  // Of fewer than a hundred frames, the second latest: the latest may be a hiccup.
  const auto rank = static_cast<std::ptrdiff_t>(
      std::min(std::ceil(0.99 * static_cast<double>(count)) - 1, static_cast<double>(count) - 2));
  std::nth_element(sorted.begin(), sorted.begin() + rank,
                   sorted.begin() + static_cast<std::ptrdiff_t>(count));
  return sorted[static_cast<std::size_t>(rank)];
}

}  // namespace previz::pipeline
