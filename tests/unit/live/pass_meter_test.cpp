// The meter shows what passes take on average. The test holds the clock.
#include "daemon/core/live/pass_meter.hpp"

#include "tests/support/test.hpp"

namespace previz::live::pass_meter_test {

constexpr std::int64_t start_ns = 1'000'000'000'000, ms_ns = 1'000'000;

render::DeviceTimes of(std::vector<render::DeviceTimes::Pass> passes, double waited_ms = 0) {
  return {.passes = std::move(passes), .submissions = 1, .waited_ms = waited_ms};
}

std::string written(const PassTimes& times) {
  std::string text;
  for (const auto& [name, ms] : times.passes) text += name + "=" + std::to_string(ms) + " ";
  return text;
}

TEST(PassMeter, AveragesTheFramesOfTheLastSecond) {
  PassMeter meter;
  EXPECT_TRUE(meter.add(start_ns, of({{"once", 1, 900}}), false));
  EXPECT_FALSE(
      meter.add(start_ns + 300 * ms_ns, of({{"shade", 3, 1}, {"extend", 9, 4}}, 2), false));
  EXPECT_FALSE(meter.add(start_ns + 499 * ms_ns, of({}), false)) << "the last reading is too new";
  EXPECT_EQ(written(meter.read()), "once=900.000000 ");
  EXPECT_TRUE(meter.add(start_ns + 1001 * ms_ns, of({{"extend", 9, 5}}, 7), false));
  EXPECT_EQ(written(meter.read()), "extend=3.000000 shade=0.333333 ") << "of three frames";
  EXPECT_DOUBLE_EQ(meter.read().waited_ms, 3);
  EXPECT_TRUE(meter.read().is_timed);
  EXPECT_EQ(meter.read().untimed, 0);
}

TEST(PassMeter, PassesThatTakeAboutAsLongKeepTheirPlaces) {
  PassMeter meter;
  const auto read = [&](int second, double a, double b) {
    meter.add(start_ns + second * 2000 * ms_ns, of({{"a", 1, a}, {"b", 1, b}}), false);
    return meter.read().passes.front().name;
  };
  EXPECT_EQ(read(0, 4.0, 4.1), "b");
  EXPECT_EQ(read(1, 4.6, 4.1), "b");
  EXPECT_EQ(read(2, 6.0, 4.1), "a");
  EXPECT_EQ(read(3, 4.0, 4.1), "a");
}

TEST(PassMeter, FramesAndRoundsAreApart) {
  PassMeter meter;
  meter.add(start_ns, of({{"shade", 1, 3}}), false);
  EXPECT_TRUE(meter.add(start_ns + ms_ns, of({{"shade", 64, 100}}), true));
  EXPECT_TRUE(meter.read().is_of_rounds);
  EXPECT_EQ(written(meter.read()), "shade=100.000000 ");
  EXPECT_TRUE(meter.add(start_ns + 2 * ms_ns, of({{"shade", 1, 4}}), false));
  EXPECT_EQ(written(meter.read()), "shade=4.000000 ");
}

TEST(PassMeter, KnowsADeviceThatTimesNothingAndPassesThatWereTooMany) {
  PassMeter meter;
  meter.add(start_ns, {}, false);
  EXPECT_FALSE(meter.read().is_timed);
  meter.add(start_ns + 600 * ms_ns, {.passes = {}, .submissions = 1, .untimed = 30}, false);
  EXPECT_TRUE(meter.read().is_timed);
  EXPECT_DOUBLE_EQ(meter.read().untimed, 15);
}

}  // namespace previz::live::pass_meter_test
