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
//
// Neither clock is trusted alone. A delay far below the line is a mistake of one of them: it is
// counted and left out, and only several in a row begin a new map. The same holds for delays that
// stay far above the line for a second. A new map also begins where the device's clock stands
// still, goes backwards or leaps over the whole half minute.
class ClockMap {
 public:
  // Returns the host time of a frame, which is after every time returned before and at most its
  // arrival. An arrival before that of an earlier frame is no bound, because frames arrive in
  // order. Whatever the device's clock does at three frames a second or more, the time is older
  // than the arrival by at most 1.3 s and the interval between two frames.
  std::int64_t to_host(std::int64_t device_ns, std::int64_t arrival_ns);

  std::uint64_t left_out() const { return left_out_; }      // delays far below the line
  std::uint64_t begun_anew() const { return begun_anew_; }  // maps after the first one

 private:
  struct Point {
    double device_s;  // since the map began
    double delay_s;   // arrival - device, since the map began; of unknown origin
  };

  void begin(std::int64_t device_ns, std::int64_t arrival_ns);
  bool is_outlier(double above_line_s, std::int64_t arrival_ns);
  bool stays_late(double above_line_s, std::int64_t arrival_ns);
  Point point_of(std::int64_t device_ns, std::int64_t arrival_ns) const;
  std::int64_t latest_arrival(std::int64_t device_ns, std::int64_t arrival_ns) const;
  void add(const Point& point);
  double least_delay_s(double device_s);

  std::optional<std::int64_t> device_origin_ns_;
  std::int64_t offset_ns_ = 0;  // arrival - device of the first frame
  std::int64_t last_device_ns_ = 0;
  std::int64_t last_host_ns_ = INT64_MIN;
  std::deque<Point> least_;  // the point of least delay of each second
  double skew_ = 0;  // how much faster the host's clock runs than the device's, as estimated

  // The last frame whose arrival was not before an earlier one's.
  std::int64_t ordered_device_ns_ = 0, ordered_arrival_ns_ = 0;
  int outliers_ = 0;                // in a row
  int late_ = 0;                    // frames in a row that are far above the line
  std::int64_t late_since_ns_ = 0;  // the arrival of the first of them
  std::uint64_t left_out_ = 0, begun_anew_ = 0;
};

}  // namespace previz
