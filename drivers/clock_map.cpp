#include "drivers/clock_map.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace previz {
namespace {

constexpr double bucket_s = 1, window_s = 30;
// No crystal in a camera is off by more; a steeper line is noise between two near points.
constexpr double greatest_skew = 500e-6;

}  // namespace

void ClockMap::add(const Point& point) {
  const double bucket = std::floor(point.device_s / bucket_s);
  if (least_.empty() || std::floor(least_.back().device_s / bucket_s) != bucket)
    least_.push_back(point);
  else if (point.delay_s < least_.back().delay_s)
    least_.back() = point;
  while (least_.front().device_s < point.device_s - window_s) least_.pop_front();
}

// Fits the edge of the points' lower convex hull that lies under their middle: of all lines under
// the points, it is the nearest to them on average.
double ClockMap::least_delay_s(double device_s) {
  std::vector<Point> hull;
  double middle = 0;
  for (const Point& point : least_) {
    const auto above = [&](const Point& a, const Point& b) {  // b is on or above a to point
      return (b.delay_s - a.delay_s) * (point.device_s - a.device_s) >=
             (point.delay_s - a.delay_s) * (b.device_s - a.device_s);
    };
    while (hull.size() >= 2 && above(hull[hull.size() - 2], hull.back())) hull.pop_back();
    hull.push_back(point);
    middle += point.device_s / static_cast<double>(least_.size());
  }
  std::size_t right = 1;
  while (right + 1 < hull.size() && hull[right].device_s < middle) ++right;
  skew_ = 0;
  if (hull.size() >= 2 && hull.back().device_s - hull.front().device_s >= 5 * bucket_s) {
    const Point &a = hull[right - 1], &b = hull[right];
    const double slope = (b.delay_s - a.delay_s) / (b.device_s - a.device_s);
    if (std::abs(slope) <= greatest_skew) {
      skew_ = slope;
      return a.delay_s + slope * (device_s - a.device_s);
    }
  }
  return std::ranges::min(least_, {}, &Point::delay_s).delay_s;
}

std::int64_t ClockMap::to_host(std::int64_t device_ns, std::int64_t arrival_ns) {
  if (!device_origin_ns_ || device_ns < last_device_ns_) {
    device_origin_ns_ = device_ns;
    offset_ns_ = arrival_ns - device_ns;
    least_.clear();
  }
  last_device_ns_ = device_ns;
  const double device_s = 1e-9 * static_cast<double>(device_ns - *device_origin_ns_);
  add({device_s, 1e-9 * static_cast<double>(arrival_ns - device_ns - offset_ns_)});
  const auto delay_ns = static_cast<std::int64_t>(std::floor(1e9 * least_delay_s(device_s)));
  std::int64_t host_ns = device_ns + offset_ns_ + delay_ns;
  host_ns = std::max(host_ns, last_host_ns_ + 1);
  host_ns = std::min(host_ns, std::max(arrival_ns, last_host_ns_ + 1));
  return last_host_ns_ = host_ns;
}

}  // namespace previz
