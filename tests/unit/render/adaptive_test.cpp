// Adaptive sampling: the estimated error is the true one, and samples go where it is.
#include "daemon/core/pipeline/refinement.hpp"
#include "daemon/core/render/picture/error_estimate.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::adaptive_test {

View small_set() {
  return random_scene(2, {.width = 64, .height = 48});
}

double rms_difference(const render::Layers& a, const render::Layers& b) {
  double sum = 0, square = 0;
  for (std::size_t i = 0; i < a.composite.size(); ++i) {
    const glm::dvec3 difference(a.composite[i] - b.composite[i]);
    const glm::dvec3 value(b.composite[i]);
    sum += glm::dot(difference, difference);
    square += glm::dot(value, value);
  }
  return std::sqrt(sum / square);
}

set::Quality quality(int samples, double error, double seconds = 0) {
  set::Quality result;
  result.samples = samples;
  result.error = error;
  result.seconds = seconds;
  return result;
}

double sum_of(const render::Layers& layers) {
  double sum = 0;
  for (const glm::vec3& value : layers.composite) sum += value.r + value.g + value.b;
  return sum;
}

// Two runs with other random numbers differ by sqrt(2) times the error of each; stratification
// makes the true error the smaller one.
TEST(Adaptive, TheEstimateIsTheTrueErrorOrAbove) {
  const View view = small_set();
  SetRenderer renderer(view);
  const render::Layers one = renderer.rendered(64, 1), other = renderer.rendered(64, 2);
  const double truth = rms_difference(one, other) / std::sqrt(2.0);
  const double estimate = render::estimate_error(one).picture;
  EXPECT_GT(estimate, 0.8 * truth);
  EXPECT_LT(estimate, 3 * truth);
}

TEST(Adaptive, ReachesTheErrorWithFewerSamplesThanEvenSampling) {
  const View view = small_set();
  SetRenderer renderer(view);
  const double target = 0.2;
  renderer.begin({{}, 1.0, view.world_from_camera});
  const auto refined = pipeline::refine(renderer, quality(8, target), {}, {});
  EXPECT_TRUE(refined.whole);
  EXPECT_LE(refined.error, target);
  expect_clean(renderer.counters());
  const auto rays = renderer.counters().rays;

  renderer.begin({{}, 1.0, view.world_from_camera});
  renderer.render(refined.samples);
  EXPECT_LT(rays, renderer.counters().rays * 3 / 4);
}

// Without photons, which a part of a picture shares among its samples.
TEST(Adaptive, LeavesTheSamplesOfAPixelAsTheyAre) {
  const View view = small_set();
  SetRenderer renderer(view, {.caustics = set::Caustics::traced});
  const render::Layers before = renderer.rendered(8);
  std::vector<std::uint32_t> limits(8 * 6, 8);
  limits[8 * 3 + 4] = 16;  // x 32..39, y 24..31
  renderer.limit_samples(limits);
  renderer.render(20);
  const render::Layers after = renderer.layers();
  const render::Layers all = renderer.rendered(16);
  for (const auto& [x, y, i] : pixels_of(64, 48)) {
    const bool inside = x / 8 == 4 && y / 8 == 3;
    EXPECT_EQ(after.composite[i], (inside ? all : before).composite[i]) << x << ", " << y;
  }
}

TEST(Adaptive, EndsWhenTheTimeIsOver) {
  const View view = small_set();
  SetRenderer renderer(view);
  renderer.begin({{}, 1.0, view.world_from_camera});
  const auto refined = pipeline::refine(renderer, quality(8, 0, 0.5), {}, {});
  EXPECT_TRUE(refined.whole);
  EXPECT_GT(refined.samples, 0);  // at least one, however slow the machine
}

// Of 5 x 1 blocks of 8 x 8 pixels only the third is noisy, in its second part, by which the first
// parts of it and of its neighbours are judged. Of the squared error eight tenths count in its own
// block, and one tenth in each neighbour.
TEST(Adaptive, APartIsJudgedByTheNextInItsBlockAndItsNeighbours) {
  const auto above = [](double error, std::uint32_t samples_of_third) {
    render::ErrorEstimate estimate;
    estimate.parts.assign(20, 0.0f);
    estimate.parts[4 * 2 + 1] = 1;
    std::vector<std::uint32_t> samples(20, 8);
    samples[4 * 2] = samples_of_third;
    return render::parts_above(estimate, 40, 8, error, samples);
  };
  std::vector<bool> expected(20);
  EXPECT_EQ(above(1.01 * std::sqrt(0.8), 8), expected);
  expected[4 * 2] = true;
  EXPECT_EQ(above(0.99 * std::sqrt(0.8), 8), expected);
  EXPECT_EQ(above(1.01 * std::sqrt(0.1), 8), expected);
  // With four times as many samples as the noisy part a half of its error is left.
  EXPECT_EQ(above(0.99 * std::sqrt(0.8 / 4), 32), expected);
  EXPECT_EQ(above(1.01 * std::sqrt(0.8 / 4), 32), std::vector<bool>(20));
  expected[4 * 1] = expected[4 * 3] = true;
  EXPECT_EQ(above(0.99 * std::sqrt(0.1), 8), expected);
}

// One block of four by one has all the noise: half of a smoothed variance is a block's own, a tenth
// its only neighbour's, and what has none gets the least.
TEST(Adaptive, SamplesAreSpreadAsTheNoiseIs) {
  render::ErrorEstimate estimate;
  estimate.blocks = {3.0f, 0.0f, 0.0f, 0.0f};
  const auto limits = render::spread_samples(estimate, 32, 8, 80);
  const double share = (4 - 2 * 0.125) / (std::sqrt(8.0 / 9) + std::sqrt(1.0 / 10));
  EXPECT_NEAR(limits[0], 80 * share * std::sqrt(8.0 / 9), 1);
  EXPECT_NEAR(limits[1], 80 * share * std::sqrt(1.0 / 10), 1);
  EXPECT_EQ(limits[2], 10u);
  EXPECT_EQ(limits[3], 10u);

  // Even noise, or none: the same for all.
  estimate.blocks.assign(4, 0.5f);
  EXPECT_EQ(render::spread_samples(estimate, 32, 8, 80), std::vector<std::uint32_t>(4, 80));
  estimate.blocks.assign(4, 0.0f);
  EXPECT_EQ(render::spread_samples(estimate, 32, 8, 80), std::vector<std::uint32_t>(4, 80));
}

// No block gets more than eight times the average, however little the others need.
TEST(Adaptive, OneNoisyBlockOfManyGetsTheMostThereIs) {
  render::ErrorEstimate estimate;
  estimate.blocks.assign(32 * 32, 0.0f);
  estimate.blocks[500] = 1;
  const auto limits = render::spread_samples(estimate, 256, 256, 64);
  EXPECT_EQ(limits[500], 512u);
  EXPECT_EQ(limits[0], 8u);
}

TEST(Adaptive, NoiseAboveWhiteIsNotSeen) {
  render::Layers layers;
  layers.width = 24;
  layers.height = 8;
  layers.white = 2;
  layers.composite.assign(24 * 8, glm::vec3(1));
  layers.variance.assign(24 * 8, glm::vec3(0.01f));
  for (const auto& [x, y, i] : pixels_of(24, 8)) {
    if (x >= 8) layers.composite[i] = glm::vec3(x < 16 ? 2.05f : 50.0f);
    if (x >= 16) layers.variance[i] = glm::vec3(25);
  }
  const render::ErrorEstimate estimate = render::estimate_error(layers);
  const double rms = std::sqrt(3 * (1 + 4 + 4) / 3.0);
  EXPECT_NEAR(estimate.blocks[0], std::sqrt(3 * 0.01) / rms, 1e-6);
  EXPECT_NEAR(estimate.blocks[1], std::sqrt(3 * 0.05 * 0.05) / rms, 1e-6);
  EXPECT_EQ(estimate.blocks[2], 0);
}

struct Group {  // of pictures that differ in their random numbers
  double squared_error = 0;
  std::vector<double> sums;

  double mean() const { return std::accumulate(sums.begin(), sums.end(), 0.0) / count(); }
  double squared_standard_error() const {
    double square = 0;
    for (const double sum : sums) square += (sum - mean()) * (sum - mean());
    return square / (count() - 1) / count();
  }
  double count() const { return static_cast<double>(sums.size()); }
};

// With the same number of samples; and as a whole the mean of many pictures is that of even ones.
TEST(Adaptive, ABudgetSpentByNeedMakesTheBetterPictureAndNoOther) {
  const View view = small_set();
  SetRenderer renderer(view);
  const auto picture = [&](int samples, bool adaptive, std::uint32_t seed) {
    set::Quality wish = quality(samples, 0);
    wish.adaptive = adaptive;
    renderer.begin({{}, 1.0, view.world_from_camera, seed});
    const pipeline::Refined refined = pipeline::refine(renderer, wish, {}, {});
    EXPECT_TRUE(refined.whole);
    EXPECT_EQ(refined.samples > wish.samples, adaptive);  // the most that a pixel got
    expect_clean(renderer.counters());
    return renderer.layers();
  };
  const render::Layers reference = picture(256, false, 1000);
  const auto add = [&](Group& group, const render::Layers& layers) {
    group.squared_error += std::pow(rms_difference(layers, reference), 2);
    group.sums.push_back(sum_of(layers));
  };
  Group even, adaptive;
  for (std::uint32_t seed = 1; seed <= 6; ++seed) {
    add(even, picture(32, false, seed));
    add(adaptive, picture(32, true, seed));
  }
  // Spread at random it would be 32/24: eight of the samples are the pilot's. With these seeds it
  // is 0.65.
  EXPECT_LT(adaptive.squared_error, 0.8 * even.squared_error);
  const double standard_error =
      std::sqrt(even.squared_standard_error() + adaptive.squared_standard_error());
  EXPECT_LT(std::abs(adaptive.mean() - even.mean()), 4 * standard_error);
}

// A small sun in the environment, for which no light samples look, is met by one path in about
// twenty thousand: a block that has missed it looks quiet. If that alone ended it, the picture
// would stay too dark (Kirk and Arvo 1991). A quarter of the picture shows a surface in this light,
// the rest a steady glow, to which errors are relative. The truth comes from light samples, whose
// error is far smaller.
TEST(Adaptive, StoppingAtAnErrorLosesNoLight) {
  View view = empty_view({0, 0, 1}, {0, 0, 0}, pinhole(32, 32, 0.5));
  add(view.scene, rectangle_mesh({4, 4}), emitter(glm::vec3(2)), glm::dmat4(1), scene::world_mixed);
  add(view.scene, rectangle_mesh({0.255, 0.255}), diffuse(glm::vec3(0.5f)), at({0, 0, 0.001}),
      scene::world_mixed);
  view.environment = uniform_environment(glm::vec3(1), 256);
  const glm::vec3 overhead = glm::normalize(glm::vec3(0.01f, 0.01f, 1));
  view.environment.radiance[lighting::texel_index(256, overhead)] = glm::vec3(1000);
  SetRenderer renderer(view, up_to_depth(1));
  const auto refined_sum = [&](const set::Quality& wish, std::uint32_t seed) {
    constexpr double exposure = 1e-6;  // nothing is clipped
    renderer.begin({{}, exposure, view.world_from_camera, seed});
    EXPECT_TRUE(pipeline::refine(renderer, wish, {}, {}).whole);
    return sum_of(renderer.layers());
  };
  const double truth = refined_sum(quality(256, 0), 1);
  renderer.set_environment(view.environment, set::LightSampling::bsdf);
  Group stopped;
  for (std::uint32_t seed = 1; seed <= 200; ++seed)
    stopped.sums.push_back(refined_sum(quality(8, 0.4), seed));
  expect_clean(renderer.counters());
  const double standard_error = std::sqrt(stopped.squared_standard_error());
  RecordProperty("relative_bias", std::to_string(stopped.mean() / truth - 1));
  RecordProperty("relative_error", std::to_string(standard_error / truth));
  // With blocks that decide for themselves it is 14 standard errors.
  EXPECT_LT(std::abs(stopped.mean() - truth), 4 * standard_error);
}

}  // namespace previz::test::adaptive_test
