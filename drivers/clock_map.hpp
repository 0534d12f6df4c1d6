// Maps a device's own clock to the host's, from nothing but the arrival times of its frames.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

namespace previz {

// A frame arrives some delay after its device stamped it; the delay varies but is never negative.
// The map is the line of least delay under the points (stamp, arrival): Moon, Skelly and Towsley,
// "Estimation and Removal of Clock Skew from Network Delay Measurements" (INFOCOM 1999), over the
// last half minute, so that a slowly drifting crystal is followed. No one-way measurement can know
// the least delay itself, so mapped times are late by that delay.
class ClockMap {
 public:
  // Returns the host time of a frame: at most its arrival, and after every time returned before. A
  // stamp that goes backwards (the device was restarted) begins a new map.
  std::int64_t to_host(std::int64_t device_ns, std::int64_t arrival_ns);

 private:
  struct Point {
    double device_s;  // since the map began
    double delay_s;   // arrival - device, since the map began; of unknown origin
  };

  void add(const Point& point);
  double least_delay_s(double device_s);

  std::optional<std::int64_t> device_origin_ns_;
  std::int64_t offset_ns_ = 0;  // arrival - device of the first frame
  std::int64_t last_device_ns_ = 0;
  std::int64_t last_host_ns_ = INT64_MIN;
  std::deque<Point> least_;  // the point of least delay of each second
  double skew_ = 0;  // how much faster the host's clock runs than the device's, as estimated
};

}  // namespace previz
