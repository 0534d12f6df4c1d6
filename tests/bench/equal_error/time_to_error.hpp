// When a method gets to an error, from a few points of its way there.
#pragma once

#include <vector>

namespace previz::bench {

struct Point {
  double cpu_s = 0, error = 0;
};

struct TimeToError {
  double cpu_s = 0;
  bool is_beyond = false;  // the points: it was not measured there
};

// Between the points around it, both axes logarithmic; beyond them as noise falls, with the inverse
// square root of time. `points` are in order of time, at least one, errors above 0.
TimeToError time_to_error(const std::vector<Point>& points, double error);

}  // namespace previz::bench
