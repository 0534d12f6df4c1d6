// The frame rate governor on simulated renderers: what a frame costs is written down, not measured.
#include "daemon/pipeline/governor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <set>

namespace previz::pipeline {
namespace pipeline_governor_test {

constexpr double fps = 25, frame_s = 1 / fps;

// A fixed part a frame, and a part for each sample at full size.
double cost(const Governor& governor, double fixed_s, double sample_s) {
  return fixed_s + sample_s * governor.samples() * governor.scale() * governor.scale();
}

double run(Governor& governor, double fixed_s, double sample_s, int frames) {
  double took = 0;
  for (int i = 0; i < frames; ++i) {
    took = cost(governor, fixed_s, sample_s);
    governor.took(took);
  }
  return took;
}

TEST(Governor, StartsWithOneSampleAndUsesTheTimeThereIs) {
  Governor governor(fps, 1);
  EXPECT_EQ(governor.samples(), 1);
  EXPECT_EQ(governor.scale(), 1);
  const double took = run(governor, 0.002, 0.003, 60);
  // Within the frame's time, and one more sample would not be within its headroom.
  EXPECT_LE(took, frame_s);
  EXPECT_GE(took + 0.003, Governor::headroom * frame_s - 0.002);
  EXPECT_EQ(governor.scale(), 1);
}

TEST(Governor, TakesNoMoreThanFiftySamples) {
  Governor governor(fps, 1);
  run(governor, 0.0005, 1e-5, 60);
  EXPECT_EQ(governor.samples(), Governor::most_samples);
}

// 60 ms for one sample at full size: half the pixels take 30 ms, and fit.
TEST(Governor, ShrinksThePictureOnlyWhereOneSampleIsTooMuch) {
  Governor governor(fps, 1);
  governor.took(cost(governor, 0, 0.060));
  EXPECT_NEAR(governor.scale(), std::sqrt(0.5), 1e-12);
  EXPECT_EQ(governor.samples(), 1);
  EXPECT_LE(run(governor, 0, 0.060, 40), frame_s);
}

TEST(Governor, GrowsAgainUpToTheSetsScaleAndNotFurther) {
  Governor governor(fps, 0.5);
  run(governor, 0, 2.0, 30);
  EXPECT_LT(governor.scale(), 0.5);
  run(governor, 0, 0.002, 200);
  EXPECT_EQ(governor.scale(), 0.5);
  EXPECT_GT(governor.samples(), 1);
}

TEST(Governor, DoesNotShrinkBelowItsSmallestPicture) {
  Governor governor(fps, 1);
  run(governor, 0, 1000, 50);
  EXPECT_GE(governor.scale(), Governor::least_scale);
  EXPECT_EQ(governor.samples(), 1);
}

TEST(Governor, AHeavierSceneCostsOneLateFrame) {
  Governor governor(fps, 1);
  run(governor, 0.001, 0.002, 60);
  const double late = cost(governor, 0.001, 0.020);  // ten times as heavy at once
  EXPECT_GT(late, frame_s);
  governor.took(late);
  EXPECT_LE(cost(governor, 0.001, 0.020), frame_s);
}

// One sample at 28 ms: two at half the pixels would fit as well. It must stay at one of the two.
TEST(Governor, DoesNotSwingBetweenSizes) {
  for (double sample_s = 0.001; sample_s < 1; sample_s *= 1.13) {
    Governor governor(fps, 1);
    run(governor, 0.001, sample_s, 200);
    std::set<double> scales;
    for (int i = 0; i < 200; ++i) {
      run(governor, 0.001, sample_s, 1);
      scales.insert(governor.scale());
    }
    EXPECT_EQ(scales.size(), 1u) << sample_s;
  }
}

// Costs that vary by a tenth (uniform, either way) stay within the tenth of headroom on average:
// the cost it goes by is never below the mean by more than what follows down.
TEST(Governor, HoldsTheRateWhenCostsVary) {
  Governor governor(fps, 1);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> vary(0.9, 1.1);
  run(governor, 0.002, 0.004, 100);
  double total = 0;
  constexpr int frames = 1000;
  for (int i = 0; i < frames; ++i) {
    const double took = vary(random) * cost(governor, 0.002, 0.004);
    total += took;
    governor.took(took);
  }
  EXPECT_LE(total / frames, frame_s);
  EXPECT_EQ(governor.scale(), 1);
}

TEST(Governor, IgnoresTimesThatAreNone) {
  Governor governor(fps, 1);
  run(governor, 0, 0.004, 30);
  const int samples = governor.samples();
  for (const double bad : {0.0, -1.0, std::nan(""), HUGE_VAL}) governor.took(bad);
  EXPECT_EQ(governor.samples(), samples);
}

}  // namespace pipeline_governor_test
}  // namespace previz::pipeline
