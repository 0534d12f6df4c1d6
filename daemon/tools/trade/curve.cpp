#include "daemon/tools/trade/curve.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

namespace previz::trade {
namespace {

// The square of an error that is too small to be measured: half its own deviation.
double positive(const SquaredError& squared) {
  return std::max({squared.value, 0.5 * squared.deviation, 1e-12});
}

// bias^2 and variance of one sample.
std::pair<double, double> bias_and_variance(const std::vector<ErrorCurve::Point>& points) {
  const ErrorCurve::Point& last = points.back();
  const auto few = std::find_if(points.rbegin(), points.rend(), [&](const ErrorCurve::Point& p) {
    return p.samples <= last.samples / 4;
  });
  if (few == points.rend()) return {0, positive(last.squared) * last.samples};
  const double n = few->samples, m = last.samples;
  const double variance =
      std::max((positive(few->squared) - positive(last.squared)) * n * m / (m - n), 0.0);
  return {std::max(positive(last.squared) - variance / m, 0.0), variance};
}

}  // namespace

void ErrorCurve::add(double samples, const SquaredError& squared) {
  assert(points_.empty() || samples > points_.back().samples);
  points_.push_back({samples, squared});
}

void ErrorCurve::extend(const ErrorCurve& like) {
  // Least squares of (y - bias - factor x) / y over the points that both have.
  double s = 0, sx = 0, sxx = 0, sy = 0, sxy = 0;
  for (const Point& own : points_) {
    const auto other = std::ranges::find(like.points_, own.samples, &Point::samples);
    if (other == like.points_.end()) continue;
    const double x = positive(other->squared), y = positive(own.squared), w = 1 / (y * y);
    s += w;
    sx += w * x;
    sxx += w * x * x;
    sy += w * y;
    sxy += w * x * y;
  }
  if (!(s > 0)) return;
  const double determinant = s * sxx - sx * sx;
  double factor = determinant > 1e-9 * s * sxx ? (s * sxy - sx * sy) / determinant : sxy / sxx;
  double bias = (sy - factor * sx) / s;
  if (bias < 0 || factor < 0) std::tie(bias, factor) = std::pair(0.0, sxy / sxx);
  const double from = points_.back().samples;
  for (const Point& point : like.points_)
    if (point.samples > from)
      points_.push_back(
          {point.samples,
           {bias + factor * positive(point.squared), factor * point.squared.deviation}});
}

SquaredError ErrorCurve::squared(double samples, bool is_unbiased) const {
  assert(!points_.empty());
  const auto above =
      std::ranges::find_if(points_, [&](const Point& point) { return point.samples >= samples; });
  if (above != points_.end() && above->samples == samples)
    return {std::max(above->squared.value, 0.0), above->squared.deviation};
  const Point& last = points_.back();
  const double relative = last.squared.deviation / positive(last.squared);
  if (above == points_.end()) {
    auto [bias, variance] = bias_and_variance(points_);
    if (is_unbiased)
      std::tie(bias, variance) = std::pair(0.0, positive(last.squared) * last.samples);
    const double value = bias + variance / samples;
    return {value, relative * value};
  }
  if (above == points_.begin())
    return {positive(above->squared) * above->samples / samples, above->squared.deviation};
  const Point& below = *std::prev(above);
  const double share = std::log(samples / below.samples) / std::log(above->samples / below.samples);
  const double value = std::exp((1 - share) * std::log(positive(below.squared)) +
                                share * std::log(positive(above->squared)));
  return {value, std::max(below.squared.deviation / positive(below.squared),
                          above->squared.deviation / positive(above->squared)) *
                     value};
}

int ErrorCurve::samples_for(double error, int most, bool is_unbiased) const {
  const auto is_reached = [&](int samples) {
    return squared(samples, is_unbiased).value <= error * error;
  };
  if (!is_reached(most)) return 0;
  // Squares fall with the samples, but for their noise.
  int low = 0, high = most;
  while (high - low > 1) {
    const int middle = low + (high - low) / 2;
    (is_reached(middle) ? high : low) = middle;
  }
  return high;
}

}  // namespace previz::trade
