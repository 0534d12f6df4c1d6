// Turns stamps of another of the host's clocks, the time of day or the time since boot, into
// CLOCK_MONOTONIC.
#pragma once

#include <cstdint>
#include <ctime>
#include <functional>
#include <optional>

namespace previz {

// One look at two clocks: the other one was read between two looks at CLOCK_MONOTONIC.
struct ClockReading {
  std::int64_t before_ns = 0, other_ns = 0, after_ns = 0;
};
using ReadClocks = std::function<ClockReading()>;

// Returns a function that reads `clock` (CLOCK_REALTIME, CLOCK_BOOTTIME) beside CLOCK_MONOTONIC.
ReadClocks read_beside_monotonic(clockid_t clock);

// Linux slews all of its clocks together, so that two of them differ by a constant until one of
// them is stepped (clock_settime, a leap second) or the machine is suspended. The difference is
// measured again for every stamp. A stamp is only trusted if it lies after the last step that was
// noticed: the clock on which an earlier stamp was taken is not known any more.
class OtherClock {
 public:
  // Must be made before the first stamp is taken, because it knows nothing of the time before.
  explicit OtherClock(ReadClocks read);

  // Returns when the stamp was taken, on CLOCK_MONOTONIC and never later than now. Returns the
  // present time for a stamp that cannot be trusted: such a time is late by the stamp's age, which
  // does ClockMap no harm, and never early.
  std::int64_t to_monotonic(std::int64_t stamp_ns);

  // Steps of the clock, and suspensions, that have been noticed.
  std::uint64_t steps() const { return steps_; }

 private:
  bool knows(const ClockReading& now);

  ReadClocks read_;
  std::int64_t least_ns_ = 0, most_ns_ = 0;  // the clocks' difference lies between these
  std::int64_t known_since_ns_ = 0;          // CLOCK_MONOTONIC; the difference held from then on
  std::uint64_t steps_ = 0;
};

// Returns the time on CLOCK_MONOTONIC of a stamp of libcamera's sensors. The documentation says
// that such stamps are CLOCK_BOOTTIME, but most of libcamera's pipelines pass the stamp of V4L2's
// buffer on, which is CLOCK_MONOTONIC. The time since boot is ahead by the time that the machine
// was suspended, and no frame was taken later than now, so a stamp of the future is one of
// CLOCK_BOOTTIME.
std::int64_t sensor_time_ns(OtherClock& boottime, std::int64_t stamp_ns, std::int64_t now_ns);

}  // namespace previz
