// Estimates when a method reaches an error, from a few measured points.
#pragma once

#include <vector>

namespace previz::bench {

struct Point {
  double cpu_s = 0, error = 0;
};

struct TimeToError {
  double cpu_s = 0;
  bool is_beyond = false;  // true: outside the points, so not measured there
};

// Interpolates between the neighbouring points on logarithmic axes; beyond the points it assumes
// that the error falls like noise, with the inverse square root of time. `points` are in order of
// time, at least one, with errors above 0.
TimeToError time_to_error(const std::vector<Point>& points, double error);

}  // namespace previz::bench
