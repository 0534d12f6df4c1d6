#include "tests/bench/equal_error/time_to_error.hpp"
#include "tests/bench/equal_error/view.hpp"
#include "tests/support/test.hpp"

namespace previz::bench::equal_error_test {

// Noise: e = 0.4 / sqrt(t).
TEST(TimeToError, FollowsThePowerLawBetweenPoints) {
  const std::vector<Point> points = {{1, 0.4}, {4, 0.2}, {16, 0.1}};
  const TimeToError time = time_to_error(points, 0.16);
  EXPECT_FALSE(time.is_beyond);
  EXPECT_NEAR(time.cpu_s, 0.4 * 0.4 / (0.16 * 0.16), 1e-9);
}

TEST(TimeToError, TellsWhereItWasNotMeasured) {
  const std::vector<Point> points = {{1, 0.4}, {4, 0.2}};
  for (const double error : {0.8, 0.05}) {
    const TimeToError time = time_to_error(points, error);
    EXPECT_TRUE(time.is_beyond) << error;
    EXPECT_NEAR(time.cpu_s, 0.16 / (error * error), 1e-9) << error;
  }
}

// The first time that the error is reached counts, not a later, luckier one.
TEST(TimeToError, TakesTheFirstCrossing) {
  const std::vector<Point> points = {{1, 0.4}, {2, 0.1}, {4, 0.3}, {8, 0.05}};
  EXPECT_LE(time_to_error(points, 0.1).cpu_s, 2);
}

TEST(WorldAlone, HasWhatItsWorldHas) {
  scene::Scene scene;
  for (const std::uint32_t presence :
       {scene::world_both, scene::world_mixed, scene::world_real, scene::world_both}) {
    scene::Instance instance;
    instance.presence = presence;
    scene.instances.push_back(instance);
  }
  set::Light dimmed;
  dimmed.gain_mixed = 0.25;
  dimmed.gain_real = 1;
  scene.lights.push_back(dimmed);
  const scene::Scene mixed = world_alone(scene, scene::world_mixed);
  const scene::Scene real = world_alone(scene, scene::world_real);
  EXPECT_EQ(mixed.instances.size(), 3u);
  EXPECT_EQ(real.instances.size(), 3u);
  for (const scene::Scene* alone : {&mixed, &real}) {
    for (const scene::Instance& instance : alone->instances)
      EXPECT_EQ(instance.presence, scene::world_both);
  }
  EXPECT_EQ(mixed.lights[0].gain_mixed, 0.25);
  EXPECT_EQ(mixed.lights[0].gain_real, 0.25);
  EXPECT_EQ(real.lights[0].gain_mixed, 1);
  EXPECT_EQ(real.lights[0].gain_real, 1);
}

}  // namespace previz::bench::equal_error_test
