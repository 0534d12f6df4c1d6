// How a picture's error falls with its samples, as measured, and on from there.
#pragma once

#include <cstddef>
#include <vector>

#include "daemon/tools/trade/measure.hpp"

namespace previz::trade {

class ErrorCurve {
 public:
  struct Point {
    double samples = 0;
    SquaredError squared;
  };

  // Adds what was measured, in ascending order of samples.
  void add(double samples, const SquaredError& squared);
  // Goes on from the last point as far as `like` is measured: squares are bias^2 + factor times
  // those of `like`, as they are in the points that both have, by least squares of relative
  // differences. Few samples do not meet what is rare, so that 1 / samples from the last point on
  // would promise too much; what is rare for one setting is rare for another.
  void extend(const ErrorCurve& like);

  bool empty() const { return points_.empty(); }
  const std::vector<Point>& points() const { return points_; }
  // Returns the square of the error with so many samples, at least 0: between points as a power of
  // the samples; beyond them as bias^2 + variance / samples through the last and one of at most a
  // quarter of its samples. With `is_unbiased` bias is 0.
  SquaredError squared(double samples, bool is_unbiased) const;
  // Returns the least samples with at most this error, or 0 if no number up to `most` has it.
  int samples_for(double error, int most, bool is_unbiased) const;

 private:
  std::vector<Point> points_;
};

}  // namespace previz::trade
