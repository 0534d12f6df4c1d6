#include "tests/bench/equal_error/time_to_error.hpp"

#include <algorithm>
#include <cmath>

namespace previz::bench {

TimeToError time_to_error(const std::vector<Point>& points, double error) {
  const auto reached =
      std::ranges::find_if(points, [&](const Point& p) { return p.error <= error; });
  if (reached == points.begin() || reached == points.end()) {
    const Point& nearest = reached == points.end() ? points.back() : points.front();
    return {nearest.cpu_s * std::pow(nearest.error / error, 2), nearest.error != error};
  }
  const Point &before = *(reached - 1), &after = *reached;
  const double share = std::log(before.error / error) / std::log(before.error / after.error);
  return {before.cpu_s * std::pow(after.cpu_s / before.cpu_s, share), false};
}

}  // namespace previz::bench
