// Runs the process in simulated time: its clocks and waits, whatever the computer's do meanwhile.
#pragma once

#include <cstdint>

namespace previz::test {

// While it lives, the C library's clocks, sleeps, condition variables, futexes, polls and timers go
// by a simulated clock, for the thread that made it and for every thread that is made from then on.
// Time stands still while one of them runs. Once all of them wait, it jumps to the first moment at
// which a wait ends, so that a day lasts as long as the work that is done in it. A thread that
// waits for a mutex or a disk counts as running. The idea is that of clknetsim, with which chrony
// is tested.
//
// A look at a clock takes some nanoseconds, so that a loop that only looks at the clock ends.
// CLOCK_REALTIME differs from CLOCK_MONOTONIC by a constant until it is stepped, as Linux has it,
// which slews both together; a drift against the world is therefore one of the simulated devices.
class SimulatedTime {
 public:
  explicit SimulatedTime(std::int64_t wall_ns);  // CLOCK_REALTIME at the beginning
  // Every thread that was made meanwhile must have ended.
  ~SimulatedTime();
  SimulatedTime(const SimulatedTime&) = delete;
  SimulatedTime& operator=(const SimulatedTime&) = delete;

  // These read the clocks without taking any time.
  std::int64_t now_ns() const;   // CLOCK_MONOTONIC
  std::int64_t wall_ns() const;  // CLOCK_REALTIME
  std::int64_t boot_ns() const;  // CLOCK_BOOTTIME

  void step_wall_clock(std::int64_t by_ns);
  // As the kernel does at 23:59:60: the last second of the day comes twice.
  void insert_leap_second() { step_wall_clock(-1'000'000'000); }
  // CLOCK_MONOTONIC stands still meanwhile.
  void suspend(std::int64_t for_ns);

  // From now on waits end at whole multiples of this time, late, as on a computer that saves power.
  void coalesce_waits(std::int64_t grain_ns);
  // Waits on the calling thread, never late.
  void sleep_exactly_until(std::int64_t time_ns) const;

  std::uint64_t jumps() const;  // of the clock, so far
};

}  // namespace previz::test
