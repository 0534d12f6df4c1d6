#include "drivers/other_clock.hpp"

#include <algorithm>
#include <utility>

#include "drivers/host_clock.hpp"

namespace previz {
namespace {

// A reading that takes longer was interrupted, and says too little.
constexpr std::int64_t widest_reading_ns = 100'000;
constexpr std::int64_t good_reading_ns = 2'000;
// The kernel rounds each clock to a nanosecond; nobody steps a clock by so little.
constexpr std::int64_t least_step_ns = 1'000;

std::int64_t read_clock_ns(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

}  // namespace

ReadClocks read_beside_monotonic(clockid_t clock) {
  return [clock] {
    ClockReading best;
    for (int tries = 0; tries < 4; ++tries) {
      ClockReading reading;
      reading.before_ns = monotonic_ns();
      reading.other_ns = read_clock_ns(clock);
      reading.after_ns = monotonic_ns();
      const std::int64_t width_ns = reading.after_ns - reading.before_ns;
      if (tries == 0 || width_ns < best.after_ns - best.before_ns) best = reading;
      if (width_ns < good_reading_ns) break;
    }
    return best;
  };
}

OtherClock::OtherClock(ReadClocks read) : read_(std::move(read)) {
  const ClockReading now = read_();
  least_ns_ = now.other_ns - now.after_ns;
  most_ns_ = now.other_ns - now.before_ns;
  known_since_ns_ = now.after_ns;
}

// Learns from a reading; returns whether the difference is still the one known before.
bool OtherClock::knows(const ClockReading& now) {
  if (now.after_ns - now.before_ns > widest_reading_ns) return false;
  const std::int64_t least_ns = now.other_ns - now.after_ns, most_ns = now.other_ns - now.before_ns;
  if (least_ns <= most_ns_ + least_step_ns && most_ns >= least_ns_ - least_step_ns) {
    least_ns_ = std::max(least_ns_, least_ns);
    most_ns_ = std::max(std::min(most_ns_, most_ns), least_ns_);
    return true;
  }
  ++steps_;
  least_ns_ = least_ns;
  most_ns_ = most_ns;
  known_since_ns_ = now.after_ns;
  return false;
}

std::int64_t OtherClock::to_monotonic(std::int64_t stamp_ns) {
  const ClockReading now = read_();
  if (!knows(now)) return now.after_ns;
  const std::int64_t time_ns =
      wrapping_difference(stamp_ns, least_ns_ + (most_ns_ - least_ns_) / 2);
  return time_ns >= known_since_ns_ && time_ns <= now.after_ns ? time_ns : now.after_ns;
}

std::int64_t sensor_time_ns(OtherClock& boottime, std::int64_t stamp_ns, std::int64_t now_ns) {
  return stamp_ns <= now_ns ? stamp_ns : std::min(boottime.to_monotonic(stamp_ns), now_ns);
}

}  // namespace previz
