// The figures of `previz trade` on made-up pictures, where they are known in closed form.
#include "daemon/tools/trade/measure.hpp"

#include "tests/support/test.hpp"

namespace previz::trade::measure_test {

// Left half uncovered, right half covered; every channel the same.
TradePicture made_up(float uncovered_added, float covered_shown, int width = 16, int height = 16) {
  TradePicture picture{width, height, {}, {}, {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const bool covered = 2 * x >= width;
      picture.mask.push_back(covered ? 1.0f : 0.0f);
      picture.added.emplace_back(covered ? covered_shown : uncovered_added);
      picture.shown.emplace_back(covered ? covered_shown : 1 + uncovered_added);
    }
  return picture;
}

TEST(TradeMeasure, ErrorsAreRelativeRmsOfTheirOwnPixels) {
  const TradeReference reference(made_up(-0.5f, 2.0f), made_up(-0.5f, 2.0f));
  const TradeErrors errors = reference.errors(made_up(-0.25f, 1.0f));
  EXPECT_DOUBLE_EQ(*errors.difference, 0.5);    // 0.25 of 0.5
  EXPECT_DOUBLE_EQ(*errors.virtual_part, 0.5);  // 1 of 2
  EXPECT_DOUBLE_EQ(*errors.picture, std::sqrt((0.25 * 0.25 + 1) / (0.5 * 0.5 + 4)));
  EXPECT_DOUBLE_EQ(*reference.noise().picture, 0.0);
}

TEST(TradeMeasure, NoiseIsHalfTheDifferenceOfTheHalves) {
  const TradeReference reference(made_up(-0.5f, 1.5f), made_up(-0.5f, 2.5f));
  EXPECT_DOUBLE_EQ(*reference.noise().difference, 0.0);
  EXPECT_DOUBLE_EQ(*reference.noise().virtual_part, 0.25);
  EXPECT_FLOAT_EQ(reference.picture().shown.back().r, 2.0f);
}

TEST(TradeMeasure, WhatIsNotInThePictureHasNoError) {
  const TradeReference reference(made_up(0.0f, 2.0f), made_up(0.0f, 2.0f));
  EXPECT_FALSE(reference.errors(made_up(0.1f, 2.0f)).difference);
}

// What all have in common, and nothing else is wrong with them.
TEST(TradeMeasure, BiasIsWhatPicturesMadeAlikeHaveInCommon) {
  const TradePicture truth = made_up(-0.5f, 0.5f);
  const TradeReference reference(truth, truth);
  TradePicture off = truth;
  for (glm::vec3& pixel : off.shown) pixel += 0.125f;
  const TradeReference::Bias bias = reference.bias(std::vector(3, off), std::vector(3, truth));
  EXPECT_DOUBLE_EQ(bias.value, 0.25);  // 0.125 of 0.5
  EXPECT_DOUBLE_EQ(bias.least, 0.0);
}

constexpr float noise_sigma = 0.125f;

// Three pictures of a truth of 0.5, with noise of their own in every channel; `bias` is added to
// the first block.
std::vector<TradePicture> noisy(float bias) {
  std::vector<TradePicture> alike(3, made_up(-0.5f, 0.5f, 32, 32));
  std::mt19937 random(7);
  std::normal_distribution<float> noise(0, noise_sigma);
  for (TradePicture& picture : alike)
    for (std::size_t i = 0; i < picture.shown.size(); ++i)
      picture.shown[i] += glm::vec3(noise(random), noise(random), noise(random)) +
                          (i % 32 < 8 && i < 8 * 32 ? bias : 0.0f);
  return alike;
}

// The sum of n = 3072 products of noise has a standard deviation of sigma^2 sqrt(n), and that of
// the mean of the three pairs sqrt(3) less; over a signal of n 0.5^2.
TEST(TradeMeasure, NoiseThatDiffersIsNoBias) {
  const TradePicture truth = made_up(-0.5f, 0.5f, 32, 32);
  const TradeReference::Bias bias =
      TradeReference(truth, truth).bias(noisy(0), std::vector(3, truth));
  EXPECT_EQ(bias.value, 0.0);
  const double n = 3 * 32 * 32;
  const double expected = std::sqrt(3 * noise_sigma * noise_sigma * std::sqrt(n / 3) / (n * 0.25));
  // 16 blocks tell a standard deviation to 1 / sqrt(32), its root to half of that: four times.
  EXPECT_NEAR(bias.least, expected, expected * 2 / std::sqrt(32.0));
}

// A bias b in one block of sixteen: its rms over the picture is b / 4. The 192 values of that block
// give sum b^2 = 12 with a standard deviation of 2 b sigma sqrt(192 / 3) = 0.5; four of these move
// the root by a twelfth.
TEST(TradeMeasure, BiasIsSeenThroughNoise) {
  const TradePicture truth = made_up(-0.5f, 0.5f, 32, 32);
  const double expected = 0.25 / 4 / 0.5;
  EXPECT_NEAR(TradeReference(truth, truth).bias(noisy(0.25f), std::vector(3, truth)).value,
              expected, expected / 12);
}

TEST(TradeMeasure, ShownIsClippedWhereTheSensorClips) {
  render::Layers layers;
  layers.width = 2;
  layers.height = 1;
  layers.composite = {glm::vec3(5.0f), glm::vec3(0.3f)};
  layers.mask = {1.0f, 0.0f};
  constexpr std::array<std::uint16_t, 6> codes{0, 0, 0, 1, 1, 1};
  const TradePicture picture = trade_picture(layers, {{{0.5, 0, 0}, {0.3, 0, 0}}, codes}, 2.0);
  EXPECT_EQ(picture.shown[0], glm::vec3(2.0f));
  EXPECT_EQ(picture.added[0], glm::vec3(1.5f));
  EXPECT_EQ(picture.added[1], glm::vec3(0.0f));  // 0.3 is no float, and yet nothing was added
}

TEST(TradeMeasure, RmsOverRounds) {
  const TradeErrors rounds[] = {{3.0, std::nullopt, 1.0}, {4.0, std::nullopt, 1.0}};
  const TradeErrors both = rms(rounds);
  EXPECT_DOUBLE_EQ(*both.difference, std::sqrt(12.5));
  EXPECT_FALSE(both.virtual_part);
  EXPECT_DOUBLE_EQ(*both.picture, 1.0);
}

TEST(TradeMeasure, AnErrorIsClaimedAboveTenTimesTheReferencesOwn) {
  const TradeErrors noise{0.01, 0.01, 0.01};
  EXPECT_EQ(within_noise({0.2, 0.2, 0.2}, noise), "");
  EXPECT_EQ(within_noise({0.09, std::nullopt, 0.05}, noise), "e_diff e_picture");
}

TEST(TradeFront, IsWhatNothingElseBeats) {
  const TradeCost costs[] = {{1, 8}, {2, 4}, {2, 5}, {3, 4}, {4, 1}, {4, 1}, {0.5, 9}};
  EXPECT_EQ(pareto_front(costs), (std::vector<bool>{true, true, false, false, true, true, true}));
}

TEST(TradeFront, OnePointIsItsOwnFront) {
  const TradeCost one[] = {{3, 3}};
  EXPECT_EQ(pareto_front(one), std::vector<bool>{true});
  EXPECT_EQ(knee(one), 0u);
}

// Ends at (1, 1) and (100, 0.01). On logarithmic axes (10, 0.1) lies on the line between them,
// (10, 0.02) below it and (50, 0.015) less far below.
TEST(TradeFront, TheKneeIsFurthestBelowTheLineBetweenTheEnds) {
  const TradeCost bent[] = {{1, 1}, {10, 0.02}, {50, 0.015}, {100, 0.01}};
  EXPECT_EQ(knee(bent), 1u);
  const TradeCost straight[] = {{1, 1}, {100, 0.01}};
  EXPECT_EQ(knee(straight), 0u);
}

// A grey picture of 1 with Gaussian noise: the square of its relative error is its variance. The
// reference has noise of its own, 1e-4 a half, of which nothing may be left in the result: without
// the subtraction it would be a fifth too much. The bound is three of the stated deviations.
TEST(TradeReference, SquaredErrorIsWithoutTheReferencesNoise) {
  std::mt19937 random(7);
  const auto grey = [&](double deviation) {
    std::normal_distribution<float> noise(0, static_cast<float>(deviation));
    TradePicture picture{64, 48, {}, {}, std::vector<float>(64 * 48, 0)};
    for (int i = 0; i < 64 * 48; ++i)
      picture.shown.emplace_back(1 + noise(random), 1 + noise(random), 1 + noise(random));
    picture.added = picture.shown;
    return picture;
  };
  const TradeReference reference(grey(0.01), grey(0.01));
  const SquaredError squared = reference.squared_error(grey(0.0158));
  EXPECT_NEAR(squared.value, 2.5e-4, 3 * squared.deviation);
  EXPECT_LT(3 * squared.deviation, 0.5e-4) << "the bound tells nothing";
  EXPECT_NEAR(error_of(squared), 0.0158, 3 * deviation_of(squared));
  const SquaredError by_half = reference.squared_error_by_second_half(grey(0.0158));
  EXPECT_NEAR(by_half.value, 2.5e-4, 3 * by_half.deviation);
}

}  // namespace previz::trade::measure_test
