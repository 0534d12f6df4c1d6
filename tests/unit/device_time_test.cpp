// Clocks and exposures of devices that do not keep the host's.
#include <gtest/gtest.h>

#include <random>

#include "drivers/clock_map.hpp"
#include "drivers/exposure_ledger.hpp"

namespace previz {
namespace device_time_test {

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

TEST(ClockMap, TimesStrictlyIncreaseEvenWhereStampsStandStill) {
  ClockMap map;
  std::int64_t before = INT64_MIN;
  for (int i = 0; i < 100; ++i) {
    const std::int64_t host = map.to_host(i / 10 * 33 * ms, second + i * 33 * ms);
    EXPECT_GT(host, before);
    before = host;
  }
}

TEST(ClockMap, ADeviceThatStartsAnewIsMappedAnew) {
  ClockMap map;
  for (int i = 0; i < 100; ++i) map.to_host(70 * second + i * 33 * ms, 10 * second + i * 33 * ms);
  EXPECT_EQ(map.to_host(1 * second, 20 * second), 20 * second);
  EXPECT_EQ(map.to_host(1 * second + 33 * ms, 20 * second + 33 * ms), 20 * second + 33 * ms);
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

}  // namespace device_time_test
}  // namespace previz
