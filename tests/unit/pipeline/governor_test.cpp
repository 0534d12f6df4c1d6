// The frame rate governor on simulated renderers: what a frame costs is written down, not measured.
#include "daemon/core/pipeline/governor.hpp"

#include "tests/support/test.hpp"

namespace previz::pipeline::governor_test {

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

TEST(Governor, StartsWithOneSampleAndTakesNoMoreThanFifty) {
  Governor governor(fps, 1);
  EXPECT_EQ(governor.samples(), 1);
  EXPECT_EQ(governor.scale(), 1);
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

// A simulated renderer: a fixed part a frame, a part for each sample of the whole picture, what a
// smaller picture costs besides, and the relative standard deviation of a frame's time.
struct Plant {
  double fixed_s = 0, sample_s = 0;
  double shrunk_s = 0;  // a frame, at any size but the full one
  double noise = 0;
  double fixed_by_pixels_s = 0;  // a frame, of the whole picture

  double mean(double samples, double pixels) const {
    return fixed_s + (fixed_by_pixels_s + sample_s * samples) * pixels +
           (pixels < 1 ? shrunk_s : 0);
  }
};

double pixels(double scale) {
  return scale * scale;
}

// What is seen of a governor at work on a plant, over a number of frames.
struct Seen {
  double work = 0;     // samples times pixels, on average
  double samples = 0;  // on average
  double scale = 0;    // the last
  int sizes = 0;       // changes of size
  int late = 0;        // frames that took longer than the rate allows
};

class Trial {
 public:
  explicit Trial(Governor governor, std::uint32_t seed = 1)
      : governor_(std::move(governor)), random_(seed) {}

  Seen run(const Plant& plant, int frames) {
    Seen seen;
    for (int i = 0; i < frames; ++i) {
      const double scale = governor_.scale();
      last_ = plant.mean(governor_.samples(), pixels(scale));
      // The logarithm of a time is taken as normal, so that no time is negative.
      const double took =
          plant.mean(governor_.samples(), pixels(scale)) * std::exp(plant.noise * normal_(random_));
      seen.work += governor_.samples() * pixels(scale) / frames;
      seen.samples += 1.0 * governor_.samples() / frames;
      seen.late += took > frame_s * (1 + 1e-9) ? 1 : 0;
      governor_.took(took);
      seen.sizes += governor_.scale() != scale ? 1 : 0;
    }
    seen.scale = governor_.scale();
    return seen;
  }

  // Returns whether the next frame would take about as long as the last one did.
  bool is_hidden(const Plant& plant) const {
    const double next = plant.mean(governor_.samples(), pixels(governor_.scale()));
    return std::abs(next - last_) < 0.25 * last_;
  }

 private:
  double last_ = 0;  // mean of the last frame's time
  Governor governor_;
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
};

constexpr int two_seconds = 2 * static_cast<int>(fps);

// Runs a governor for the two seconds in which it may settle, and returns what is seen after them.
Seen settled(const Plant& plant, int frames) {
  Trial trial(Governor(fps, 1));
  trial.run(plant, two_seconds);
  return trial.run(plant, frames);
}

TEST(Governor, FindsWhatFitsBesideAFixedCost) {
  struct Row {
    double fixed_s, sample_s;
    int fit;  // samples that a frame's planned time has room for
  };
  const Row rows[] = {{0.002, 0.003, 11}, {0.010, 0.003, 8}, {0.018, 0.001, 18},
                      {0.020, 0.003, 5},  {0.025, 0.003, 3}, {0.030, 0.001, 6}};
  for (const Row& row : rows) {
    SCOPED_TRACE(std::to_string(1e3 * row.fixed_s) + " ms fixed, " +
                 std::to_string(1e3 * row.sample_s) + " ms a sample");
    const Seen seen = settled({row.fixed_s, row.sample_s}, 100);
    EXPECT_GE(seen.samples, 0.9 * row.fit);
    EXPECT_LE(seen.samples, 1.1 * row.fit);
    EXPECT_EQ(seen.scale, 1);
    EXPECT_EQ(seen.sizes, 0);
    EXPECT_EQ(seen.late, 0);
  }
  // Costs that are off by up to a tenth, either way, vary by 5.8 %: that is no reason to shrink.
  const Seen varying = settled({.fixed_s = 0.002, .sample_s = 0.004, .noise = 0.058}, 1000);
  EXPECT_EQ(varying.scale, 1);
}

// 40 ms fixed and 1 ms a sample: where the fixed part is the host's, no size fits, and the picture
// stays whole; where it is that of the pixels, half of them leave room for 32 samples.
TEST(Governor, GivesUpPixelsOnlyWhereTheyCostTheTime) {
  const Seen whole = settled({.fixed_s = 0.040, .sample_s = 0.001}, 200);
  EXPECT_EQ(whole.scale, 1);
  EXPECT_EQ(whole.sizes, 0);

  const Seen half = settled({.sample_s = 0.001, .fixed_by_pixels_s = 0.040}, 200);
  EXPECT_NEAR(half.scale, std::sqrt(0.5), 1e-12);
  EXPECT_GE(half.samples, 0.9 * 32);
  EXPECT_EQ(half.late, 0);
}

// A sample of the whole picture takes 25 ms. The last two rows fit at no size, and would not at the
// least: 40.4 and 45.4 ms there, 50 and 55 at full size, which is therefore kept.
TEST(Governor, AFixedCostDoesNotMakeThePictureCollapse) {
  struct Row {
    double fixed_s, shrunk_s, scale;
    bool fits;
  };
  const Row rows[] = {{0.000, 0.000, 1, true},
                      {0.015, 0.000, std::sqrt(0.5), true},
                      {0.020, 0.010, std::sqrt(0.125), true},
                      {0.025, 0.015, 1, false},
                      {0.030, 0.015, 1, false}};
  for (const Row& row : rows) {
    SCOPED_TRACE(std::to_string(1e3 * row.fixed_s) + " ms fixed, " +
                 std::to_string(1e3 * row.shrunk_s) + " ms for a smaller picture");
    const Seen seen = settled({row.fixed_s, 0.025, row.shrunk_s}, 200);
    EXPECT_NEAR(seen.scale, row.scale, 1e-12);
    EXPECT_EQ(seen.sizes, 0);
    if (row.fits) {
      EXPECT_LE(seen.late, 2) << "one frame in a hundred may be";
    }
  }
}

// What a governor that knew the plant would do with this much time a frame; 0 if nothing fits.
double work_that_fits(const Plant& plant, double planned_s) {
  set::Quality quality;
  for (const set::PreviewStep& step : preview_steps(quality)) {
    const double share = pixels(step.scale);
    if (plant.mean(1, share) > planned_s) continue;
    const double samples =
        1 + std::floor((planned_s - plant.mean(1, share)) / (plant.sample_s * share));
    return std::min<double>(samples, Governor::most_samples) * share;
  }
  return 0;
}

// The 99th percentile of a normal distribution is 2.326 deviations above its mean.
double planned_s(const Plant& plant) {
  return std::min(Governor::headroom, std::exp(-2.326 * plant.noise)) * frame_s;
}

// Within 2 s of the start, and of any step of the costs, 90 % of what fits is used. A plant where
// one more sample, or a whole size, fits by less than 5 % of the time may be decided either way:
// the 99th percentile of a hundred frames has a standard error of sqrt(0.01 * 0.99 / 100) / 0.0267
// = 0.37 deviations of a frame, of which two are 4 % where the noise is 5 %, and their mean one of
// 0.5 %. So may one by which a size that was left would fit with less than the 5 % that the
// governor wants to spare for it.
TEST(Governor, SettlesWithinTwoSecondsWhateverFramesCost) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> fixed(0, 0.040),
      log_sample(std::log(0.0003), std::log(0.030));
  int late = 0, frames = 0;
  for (std::uint32_t trial = 0; trial < 150; ++trial) {
    Trial governor(Governor(fps, 1), trial);
    for (int step = 0; step < 3; ++step) {
      constexpr double noises[] = {0, 0.02, 0.05};
      const Plant plant{.fixed_s = fixed(random),
                        .sample_s = std::exp(log_sample(random)),
                        .noise = noises[trial % 3]};
      SCOPED_TRACE("trial " + std::to_string(trial) + ", step " + std::to_string(step) + ": " +
                   std::to_string(1e3 * plant.fixed_s) + " ms fixed, " +
                   std::to_string(1e3 * plant.sample_s) + " ms a sample, noise " +
                   std::to_string(plant.noise));
      // A frame that takes as long as before does not say that costs are others: it takes the one
      // frame in a hundred that is varied where a sample is all that fits.
      const bool is_hidden = governor.is_hidden(plant);
      governor.run(plant, is_hidden ? 250 : two_seconds);
      const Seen seen = governor.run(plant, 100);
      const double fit = std::min(work_that_fits(plant, planned_s(plant)),
                                  work_that_fits(plant, 0.95 * 0.95 * planned_s(plant)));
      EXPECT_GE(seen.work, 0.9 * fit);
      if (fit == 0) continue;
      late += seen.late;
      frames += 100;
    }
  }
  EXPECT_LE(late, 0.01 * frames) << "of " << frames;
}

// A frame of two hundred takes three times as long, for reasons that are not the renderer's.
TEST(Governor, AHiccupCostsOneFrameOfFewerSamplesAndNoPixels) {
  Governor governor(fps, 1);
  const Plant plant{0.015, 0.002};
  double samples = 0;
  for (int i = 0; i < 1000; ++i) {
    const bool is_hiccup = i % 200 == 70;
    const int before = governor.samples();
    governor.took((is_hiccup ? 3 : 1) * plant.mean(before, pixels(governor.scale())));
    ASSERT_EQ(governor.scale(), 1) << i;
    if (is_hiccup) {
      EXPECT_LT(governor.samples(), before) << i;
    }
    samples += before / 1000.0;
  }
  EXPECT_GE(samples, 9) << "10 fit";
}

// The set's order: denoised pictures of one sample are worth more to this crew than half the
// pixels, and four samples at half the pixels more than one of the whole.
TEST(Governor, FollowsTheOrderOfTheSet) {
  const std::vector<set::PreviewStep> steps{
      {4, 1, false}, {4, std::sqrt(0.5), false}, {1, 1, true}, {1, 0.5, true}};
  const auto settles = [&](double sample_s) {
    Governor governor(fps, steps);
    for (int i = 0; i < 200; ++i) {
      const set::PreviewStep step = governor.step();
      governor.took((*step.denoise ? 0.008 : 0.001) +
                    sample_s * governor.samples() * pixels(step.scale));
    }
    return governor;
  };
  EXPECT_EQ(settles(0.008).step(), steps[0]);  // 33 of 36 ms
  EXPECT_EQ(settles(0.016).step(), steps[1]);  // 65 would not, 33 does
  EXPECT_EQ(settles(0.024).step(), steps[2]);  // 49 would not, 32 does
  EXPECT_EQ(settles(0.050).step(), steps[3]);
  EXPECT_GE(settles(0.008).samples(), 4);
}

TEST(PreviewSteps, AreTheSetsOwnOrEverSmallerPictures) {
  set::Quality quality;
  quality.scale = 0.5;
  const std::vector<set::PreviewStep> steps = preview_steps(quality);
  ASSERT_EQ(steps.size(), 5u);  // 1/2, and half the pixels each time down to 1/8
  EXPECT_EQ(steps.front(), (set::PreviewStep{1, 0.5, {}}));
  EXPECT_NEAR(steps.back().scale, Governor::least_scale, 1e-12);
  quality.steps = {{2, 0.7, true}};
  EXPECT_EQ(preview_steps(quality), quality.steps);
}

TEST(Governor, IgnoresTimesThatAreNone) {
  Governor governor(fps, 1);
  run(governor, 0, 0.004, 30);
  const int samples = governor.samples();
  for (const double bad : {0.0, -1.0, std::nan(""), HUGE_VAL}) governor.took(bad);
  EXPECT_EQ(governor.samples(), samples);
}

}  // namespace previz::pipeline::governor_test
