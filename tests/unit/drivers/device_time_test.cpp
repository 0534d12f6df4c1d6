// Clocks and exposures of devices that do not keep the host's.
#include "drivers/clock_map.hpp"
#include "drivers/exposure_ledger.hpp"
#include "drivers/frame_order.hpp"
#include "drivers/host_clock.hpp"
#include "drivers/other_clock.hpp"
#include "tests/support/test.hpp"

namespace previz::device_time_test {

constexpr std::int64_t ms = 1'000'000, second = 1000 * ms;

// A device at 30 Hz whose clock is off by `skew` and a large offset; arrivals late by `least` and
// an exponential tail of 2 ms, as queues make it.
struct Device {
  double skew;
  std::int64_t least;
  std::mt19937 random{7};
  std::exponential_distribution<double> tail{1.0 / (2 * ms)};

  std::int64_t host(int frame) const { return 5 * second + frame * second / 30; }
  std::int64_t stamp(int frame) const {
    return static_cast<std::int64_t>(static_cast<double>(host(frame)) / (1 + skew)) +
           900'000 * second;
  }
  std::int64_t arrival(int frame) {
    return host(frame) + least + static_cast<std::int64_t>(tail(random));
  }
};

// After the window the line lies under 30 least points of 30 exponential draws each: each is above
// the true line by 2 ms / 30 on average. The line through two of them is off by a few times that;
// 0.5 ms is five standard deviations of the worst.
TEST(ClockMap, FollowsAClockThatRunsFastOrSlow) {
  for (const double skew : {-80e-6, 0.0, 80e-6}) {
    Device device{skew, 3 * ms};
    ClockMap map;
    for (int i = 0; i < 3000; ++i) {
      const std::int64_t arrival = device.arrival(i);
      const std::int64_t host = map.to_host(device.stamp(i), arrival);
      EXPECT_LE(host, arrival);
      if (i > 900) {
        EXPECT_NEAR(double(host - device.host(i) - device.least), 0, 0.5 * ms) << i;
      }
    }
  }
}

TEST(ClockMap, ADeviceThatStartsAnewIsMappedAnew) {
  ClockMap map;
  for (int i = 0; i < 100; ++i) map.to_host(70 * second + i * 33 * ms, 10 * second + i * 33 * ms);
  EXPECT_EQ(map.to_host(1 * second, 20 * second), 20 * second);
  EXPECT_EQ(map.to_host(1 * second + 33 * ms, 20 * second + 33 * ms), 20 * second + 33 * ms);
}

// A wall clock that was stepped while a frame was under way made its arrival that much too early:
// by more than other delays differ, or only enough to be before the arrival of the frame before.
// The bounds are those of FollowsAClockThatRunsFastOrSlow.
TEST(ClockMap, OneArrivalFarTooEarlyMovesNoStamp) {
  for (const std::int64_t mistake : {45 * ms, 100 * ms, second, 10 * second}) {
    Device device{20e-6, 3 * ms};
    ClockMap map;
    for (int i = 0; i < 3600; ++i) {
      const std::int64_t arrival = device.arrival(i) - (i == 1800 ? mistake : 0);
      const std::int64_t host = map.to_host(device.stamp(i), arrival);
      if (i > 900) {
        ASSERT_NEAR(double(host - device.host(i) - device.least), 0, 0.5 * ms) << i;
      }
    }
    EXPECT_EQ(map.left_out(), 1u);
    EXPECT_EQ(map.begun_anew(), 0u);
  }
}

// A map that begins with such an arrival finds out after a second, in which delays stay late.
TEST(ClockMap, AFirstArrivalFarTooEarlyIsFoundOut) {
  Device device{0, 3 * ms};
  ClockMap map;
  for (int i = 0; i < 120; ++i) {
    const std::int64_t arrival = device.arrival(i);
    const std::int64_t host =
        map.to_host(device.stamp(i), i == 0 ? arrival - 10 * second : arrival);
    if (i > 33) {
      ASSERT_GE(host, device.host(i) + device.least) << i;
      ASSERT_LE(host, arrival) << i;
    }
  }
}

TEST(ClockMap, ADeviceWithoutAClockHasTheTimesOfItsArrivals) {
  ClockMap map;
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(map.to_host(0, second + i * 33 * ms), second + i * 33 * ms);
  }
}

// 64 bits that overflow are no reason to begin anew.
TEST(ClockMap, GoesOnWhereTheDevicesCounterOverflows) {
  for (const std::int64_t start : {std::numeric_limits<std::int64_t>::max(), std::int64_t{-1}}) {
    Device device{0, 3 * ms};
    ClockMap map;
    for (int i = 0; i < 300; ++i) {
      const std::int64_t passed = device.host(i) - device.host(100);
      const std::int64_t arrival = device.arrival(i);
      const std::int64_t host = map.to_host(wrapping_sum(start, passed), arrival);
      ASSERT_GE(host, device.host(i) + device.least - ms / 2) << i;
      ASSERT_LE(host, arrival) << i;
    }
    EXPECT_EQ(map.begun_anew(), 0u);
  }
}

struct HostileClock {
  const char* name;
  std::function<std::int64_t(int frame)> stamp;
};

// Whatever the device's clock says, frames have increasing times that are not later than their
// arrivals, and not older than the header allows: 1.3 s and an interval.
TEST(ClockMap, AHostileClockDoesNoHarm) {
  std::mt19937_64 random{3};
  const std::int64_t frame = second / 30;
  const std::vector<HostileClock> clocks{
      {"zero for ever", [](int) { return std::int64_t{0}; }},
      {"stands still for 10 s",
       [&](int i) { return (i < 300 ? i : std::max(300, i - 300)) * frame; }},
      {"jumps back every 2 s", [&](int i) { return i % 60 * frame; }},
      {"jumps back by less than a frame", [&](int i) { return i * frame - i / 50 * 20 * ms; }},
      {"jumps ahead", [&](int i) { return i * frame + i / 100 * 20 * second; }},
      {"jumps ahead by minutes", [&](int i) { return i * frame + i / 100 * 200 * second; }},
      {"leaps to and fro", [&](int i) { return i * frame + (i % 2 << 30) * 4 * second; }},
      {"leaps now and then", [&](int i) { return i * frame + (i % 10 == 0 ? 5 * second : 0); }},
      {"32 bits of microseconds that overflow",
       [&](int i) {
         return std::int64_t{static_cast<std::uint32_t>(i * frame / 1000 - 50'000'000)} * 1000;
       }},
      {"a tenth of the speed", [&](int i) { return i * frame / 10; }},
      {"ten times the speed", [&](int i) { return i * frame * 10; }},
      {"a hundredth too slow", [&](int i) { return i * frame / 100 * 99; }},
      {"counts frames", [](int i) { return std::int64_t{i}; }},
      {"random", [&](int) { return static_cast<std::int64_t>(random()); }},
      {"random steps",
       [&, at = std::int64_t{0}](int) mutable {
         return at = wrapping_sum(at, static_cast<std::int64_t>(random() % (70 * ms)));
       }},
  };
  for (const HostileClock& clock : clocks) {
    ClockMap map;
    std::int64_t before = INT64_MIN;
    for (int i = 0; i < 3000; ++i) {
      const std::int64_t arrival = 50 * second + i * frame;
      const std::int64_t host = map.to_host(clock.stamp(i), arrival);
      ASSERT_GT(host, before) << clock.name << ", frame " << i;
      ASSERT_LE(host, arrival) << clock.name << ", frame " << i;
      ASSERT_GE(host, arrival - 1300 * ms - frame) << clock.name << ", frame " << i;
      before = host;
    }
  }
}

// ---- the host's own clocks

// The host, whose other clock is stepped at given times. Reading a clock takes 50 ns, and so does
// what follows, unless something interrupts.
struct SteppedHost {
  std::int64_t now = 100 * second;                             // CLOCK_MONOTONIC
  std::int64_t ahead = 1'700'000'000 * second;                 // of CLOCK_MONOTONIC
  std::vector<std::pair<std::int64_t, std::int64_t>> steps{};  // when and by how much, in order
  std::size_t done = 0;
  std::int64_t interruption = 50;

  // Returns the other clock's time, which comes later with each call.
  std::int64_t other_at(std::int64_t time) {
    for (; done < steps.size() && steps[done].first <= time; ++done) ahead += steps[done].second;
    return time + ahead;
  }
  OtherClock other() {
    return OtherClock([this] {
      ClockReading reading;
      reading.before_ns = now;
      reading.other_ns = other_at(now += 50);
      reading.after_ns = now += interruption;
      return reading;
    });
  }
};

TEST(OtherClockTest, AStampIsTakenBackByTheClocksDifference) {
  SteppedHost host;
  OtherClock other = host.other();
  const std::int64_t begin = host.now, stamp = host.other_at(begin + second);
  host.now += 3 * second;
  EXPECT_NEAR(double(other.to_monotonic(stamp) - begin), double(second), 100);
  // One of the future, and some of before the clocks were first compared.
  for (const std::int64_t wrong :
       {stamp + 10 * second, stamp - 10 * second, std::int64_t{0}, INT64_MIN}) {
    const std::int64_t time = other.to_monotonic(wrong);
    EXPECT_EQ(time, host.now) << wrong;
  }
  EXPECT_EQ(other.steps(), 0u);
}

TEST(OtherClockTest, AStampFromBeforeAStepIsOfNow) {
  for (const std::int64_t step : {10 * second, -10 * second, -second, 5 * ms, 3600 * second}) {
    SteppedHost host;
    host.steps = {{host.now + 40 * ms, step}};
    OtherClock other = host.other();
    const std::int64_t stamp = host.other_at(host.now + 30 * ms);
    host.now += 50 * ms;
    const std::int64_t time = other.to_monotonic(stamp);
    EXPECT_EQ(time, host.now);
    EXPECT_EQ(other.steps(), 1u);
    const std::int64_t later = host.now + 10 * ms, its_stamp = host.other_at(later);
    host.now += 50 * ms;
    EXPECT_NEAR(double(other.to_monotonic(its_stamp) - later), 0, 100);
  }
}

// What another clock says about a time that is 10 ms wide is not used.
TEST(OtherClockTest, AStampIsOfNowWhereReadingTheClocksWasInterrupted) {
  SteppedHost host;
  OtherClock other = host.other();
  const std::int64_t taken = host.now + ms, stamp = host.other_at(taken);
  host.now += 30 * ms;
  host.interruption = 10 * ms;
  const std::int64_t time = other.to_monotonic(stamp);
  EXPECT_EQ(time, host.now);
  host.interruption = 50;
  EXPECT_NEAR(double(other.to_monotonic(stamp) - taken), 0, 100);
  EXPECT_EQ(other.steps(), 0u);
}

TEST(OtherClockTest, ReadsTheClocksOfThisMachine) {
  OtherClock wall(read_beside_monotonic(CLOCK_REALTIME));
  const std::int64_t before = monotonic_ns();
  timespec stamp{};
  clock_gettime(CLOCK_REALTIME, &stamp);
  const std::int64_t time = wall.to_monotonic(stamp.tv_sec * second + stamp.tv_nsec);
  EXPECT_GE(time, before - 100'000);  // as wide as a reading may be
  EXPECT_LE(time, monotonic_ns());
}

// The clock of a machine that was suspended for an hour before, and is for another one now.
TEST(SensorTime, IsMonotonicWhicheverOfTheTwoClocksTheStampIsOf) {
  SteppedHost host;
  host.ahead = 3600 * second;
  const std::int64_t slept = host.now + 10 * second;
  host.steps = {{slept, 3600 * second}};
  OtherClock boottime = host.other();
  for (int i = 1; i < 600; ++i) {
    const std::int64_t before = host.now, taken = before + 10 * ms;
    const std::int64_t since_boot = host.other_at(taken);
    host.now += 33 * ms;
    const std::int64_t now = host.now;
    EXPECT_EQ(sensor_time_ns(boottime, taken, now), taken);
    const std::int64_t time = sensor_time_ns(boottime, since_boot, now);
    const bool during_the_sleep = before < slept && slept <= now;
    EXPECT_NEAR(double(time - (during_the_sleep ? now : taken)), 0, 100);
  }
  EXPECT_EQ(boottime.steps(), 1u);
}

// As Aravis stamps a frame: with the microseconds of the wall clock when its first packet comes.
// The frame is taken 20 ms later, and the wall clock is stepped at any time, every few seconds. The
// bound is that of FollowsAClockThatRunsFastOrSlow, since a frame during which the clock was
// stepped has a late arrival, and 29 of 30 draws remain.
TEST(WallClock, StepsMoveNoStampOfAFrame) {
  constexpr std::array steps{10 * second, -10 * second, second, -second,
                             500 * ms,    -4 * ms,      20 * ms};
  std::mt19937 random{11};
  SteppedHost host;
  Device device{30e-6, 3 * ms};
  const std::int64_t begin = host.now - device.host(0);
  for (std::int64_t at = host.now; at < host.now + 120 * second; at += random() % 4000 * ms)
    host.steps.emplace_back(at += 200 * ms, steps[random() % steps.size()]);
  OtherClock wall = host.other();
  ClockMap map;
  for (int i = 0; i < 3600; ++i) {
    const std::int64_t arrival = begin + device.arrival(i);
    const std::int64_t stamp = host.other_at(arrival) / 1000 * 1000;
    host.now = std::max(host.now, arrival + 20 * ms);
    const std::int64_t known = wall.to_monotonic(stamp);
    ASSERT_GE(known, arrival - 1100) << i;  // a microsecond, and what a reading takes
    const std::int64_t time = map.to_host(device.stamp(i), known);
    if (i > 900) {
      ASSERT_NEAR(double(time - begin - device.host(i) - device.least), 0, 0.5 * ms) << i;
    }
  }
  EXPECT_GT(wall.steps(), 30u);
  EXPECT_EQ(map.begun_anew(), 0u);
}

// While the machine is suspended, CLOCK_MONOTONIC stands still and the camera's clock goes on.
TEST(WallClock, SuspendMovesNoStampPastItsArrival) {
  for (const std::int64_t asleep : {10 * second, 3600 * second}) {
    SteppedHost host;
    Device device{0, 3 * ms};
    const std::int64_t begin = host.now - device.host(0);
    constexpr int suspended = 1200;
    host.steps = {{begin + device.host(suspended) - 5 * ms, asleep}};
    OtherClock wall = host.other();
    ClockMap map;
    for (int i = 0; i < 3600; ++i) {
      const std::int64_t arrival = begin + device.arrival(i);
      const std::int64_t stamp = host.other_at(arrival);
      host.now = std::max(host.now, arrival + 20 * ms);
      const std::int64_t on_device = device.stamp(i) + (i < suspended ? 0 : asleep);
      const std::int64_t known = wall.to_monotonic(stamp);
      const std::int64_t time = map.to_host(on_device, known) - begin;
      ASSERT_GE(time, device.host(i) + device.least - ms / 2) << i;
      ASSERT_LE(time, known - begin) << i;
      if (i > suspended + 900) {
        ASSERT_NEAR(double(time - device.host(i) - device.least), 0, 0.5 * ms) << i;
      }
    }
    EXPECT_EQ(wall.steps(), 1u);
    EXPECT_EQ(map.begun_anew(), 1u);
  }
}

constexpr Exposure dark{0.001, 1}, bright{0.010, 1};

TEST(ExposureLedger, FramesAroundAChangeAreNotKnown) {
  ExposureLedger ledger(dark, 2);
  EXPECT_EQ(ledger.of_frame(10), dark);
  ledger.changed(25, 27, bright);
  EXPECT_EQ(ledger.of_frame(20), dark);  // captured before, taken later
  EXPECT_EQ(ledger.of_frame(26), std::nullopt);
  EXPECT_EQ(ledger.of_frame(30), std::nullopt);  // two frames to settle
  EXPECT_EQ(ledger.of_frame(40), std::nullopt);
  EXPECT_EQ(ledger.of_frame(50), bright);
  EXPECT_EQ(ledger.of_frame(60), bright);
}

TEST(ExposureLedger, ChangesInARowCountFromTheLast) {
  ExposureLedger ledger(dark, 1);
  ledger.changed(10, 11, bright);
  ledger.changed(15, 16, {0.005, 2});
  EXPECT_EQ(ledger.of_frame(20), std::nullopt);
  EXPECT_EQ(ledger.of_frame(30), (Exposure{0.005, 2}));
}

TEST(ExposureLedger, ADeviceThatSettlesAtOnce) {
  ExposureLedger ledger(dark, 0);
  ledger.changed(10, 11, bright);
  EXPECT_EQ(ledger.of_frame(9), dark);
  EXPECT_EQ(ledger.of_frame(12), bright);
}

// ---- the kernel's times of video frames

TEST(FrameOrderTest, AStampThatStandsStillOrIsOfLongAgoGivesWayToTheArrival) {
  DeviceCounters counters;
  FrameOrder order(counters);
  EXPECT_EQ(order.time_of(100 * second, 101 * second), 100 * second);
  EXPECT_EQ(order.time_of(100 * second, 102 * second), 102 * second);
  EXPECT_EQ(order.time_of(100 * second, 103 * second), 103 * second);
  EXPECT_EQ(order.time_of(1 * second, 104 * second), 104 * second);
  EXPECT_EQ(order.time_of(104 * second + ms, 105 * second), 104 * second + ms);
  EXPECT_EQ(counters["frames with an impossible time stamp"], 3u);
  EXPECT_EQ(order.time_of(std::nullopt, 106 * second), 106 * second);
  EXPECT_EQ(order.time_of(105 * second, 107 * second), 106 * second + 1);
  EXPECT_EQ(counters["frames without a kernel time stamp"], 1u);
}

}  // namespace previz::device_time_test
