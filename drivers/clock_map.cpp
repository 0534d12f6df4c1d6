#include "drivers/clock_map.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "drivers/host_clock.hpp"

namespace previz {
namespace {

constexpr double bucket_s = 1, window_s = 30;
// No crystal in a camera is off by more; a steeper line is noise between two near points.
constexpr double greatest_skew = 500e-6;
// A delay that is so much shorter than every other of the last half minute is a mistake, unless as
// many frames in a row agree on it.
constexpr double outlier_s = 0.05;
constexpr int outliers_believed = 4;
// Delays that are so much longer for so long are not those of a busy network or a busy host, which
// catch up: the device's clock stood still or was set back.
constexpr double late_s = 0.25;
constexpr std::int64_t late_patience_ns = 1'000'000'000;
constexpr int late_frames_believed = 3;

}  // namespace

void ClockMap::begin(std::int64_t device_ns, std::int64_t arrival_ns) {
  if (device_origin_ns_) ++begun_anew_;
  device_origin_ns_ = ordered_device_ns_ = device_ns;
  ordered_arrival_ns_ = arrival_ns;
  offset_ns_ = wrapping_difference(arrival_ns, device_ns);
  least_.clear();
  outliers_ = late_ = 0;
}

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

// Returns whether one of the two clocks must be wrong about this delay.
bool ClockMap::is_outlier(double above_line_s, std::int64_t arrival_ns) {
  const bool outlier = arrival_ns < ordered_arrival_ns_ || above_line_s < -outlier_s;
  outliers_ = outlier ? outliers_ + 1 : 0;
  return outlier;
}

bool ClockMap::stays_late(double above_line_s, std::int64_t arrival_ns) {
  if (above_line_s <= late_s) {
    late_ = 0;
    return false;
  }
  if (late_++ == 0) late_since_ns_ = arrival_ns;
  return late_ >= late_frames_believed && arrival_ns - late_since_ns_ >= late_patience_ns;
}

// Returns when a frame can have arrived at the latest. For an arrival out of order that is reckoned
// from the last one in order by the device's clock, of which no more than a second is believed.
std::int64_t ClockMap::latest_arrival(std::int64_t device_ns, std::int64_t arrival_ns) const {
  if (arrival_ns >= ordered_arrival_ns_) return arrival_ns;
  const std::int64_t passed_ns = wrapping_difference(device_ns, ordered_device_ns_);
  return ordered_arrival_ns_ + std::clamp<std::int64_t>(passed_ns, 0, 1'000'000'000);
}

ClockMap::Point ClockMap::point_of(std::int64_t device_ns, std::int64_t arrival_ns) const {
  const std::int64_t delay_ns =
      wrapping_difference(wrapping_difference(arrival_ns, device_ns), offset_ns_);
  return {1e-9 * static_cast<double>(wrapping_difference(device_ns, *device_origin_ns_)),
          1e-9 * static_cast<double>(delay_ns)};
}

std::int64_t ClockMap::to_host(std::int64_t device_ns, std::int64_t arrival_ns) {
  const std::int64_t step_ns = wrapping_difference(device_ns, last_device_ns_);
  last_device_ns_ = device_ns;
  if (!device_origin_ns_ || step_ns <= 0 || 1e-9 * static_cast<double>(step_ns) > window_s)
    begin(device_ns, arrival_ns);
  Point point = point_of(device_ns, arrival_ns);
  const double above_line_s = least_.empty() ? 0 : point.delay_s - least_delay_s(point.device_s);
  bool outlier = is_outlier(above_line_s, arrival_ns);
  if (outliers_ >= outliers_believed || stays_late(above_line_s, arrival_ns)) {
    begin(device_ns, arrival_ns);
    point = {0, 0};
    outlier = false;
  }
  if (outlier) {
    ++left_out_;
  } else {
    add(point);
    ordered_device_ns_ = device_ns;
    ordered_arrival_ns_ = arrival_ns;
  }
  const auto delay_ns = static_cast<std::int64_t>(std::floor(1e9 * least_delay_s(point.device_s)));
  const std::int64_t on_line_ns = wrapping_sum(wrapping_sum(device_ns, offset_ns_), delay_ns);
  const std::int64_t host_ns = std::min(on_line_ns, latest_arrival(device_ns, arrival_ns));
  return last_host_ns_ = std::max(host_ns, last_host_ns_ + 1);
}

}  // namespace previz
