#include "daemon/core/lighting/smoothing.hpp"

#include "tests/support/test.hpp"

namespace previz::lighting::smoothing_test {

constexpr int picture_side = 64, picture_pixels = picture_side * picture_side;
constexpr float pixel_sigma = 0.01f;
constexpr std::int64_t frame_ns = 40'000'000;

// Radiance by pixel, with Gaussian noise; `stated` over the noise that the picture admits.
template <typename Scene>
HdrPicture noisy(const Scene& scene, std::mt19937& random, float stated = 1) {
  std::normal_distribution<float> normal(0, pixel_sigma);
  HdrPicture picture{picture_side, picture_side, {}, std::vector<std::uint8_t>(picture_pixels), {}};
  for (int p = 0; p < picture_pixels; ++p) {
    const float radiance = scene(p);
    picture.radiance.emplace_back(radiance + normal(random), radiance + normal(random),
                                  radiance + normal(random));
    picture.variance.emplace_back(stated * stated * pixel_sigma * pixel_sigma);
  }
  return picture;
}

double deviation(const HdrPicture& picture, double mean) {
  double squares = 0;
  for (const glm::vec3& r : picture.radiance) squares += std::pow(r.g - mean, 2);
  return std::sqrt(squares / picture_pixels);
}

double sum_of(const HdrPicture& picture) {
  double sum = 0;
  for (const glm::vec3& r : picture.radiance) sum += r.g;
  return sum;
}

const auto grey = [](int) { return 1.0f; };

// An exponential average of share a has the variance a / (2 - a) of a single picture.
TEST(Smoothing, AveragesNoise) {
  std::mt19937 random(1);
  for (const float stated : {1.0f, 0.4f}) {  // also where the camera is noisier than it says
    Smoothing smoothing(0.4);
    HdrPicture picture;
    for (int i = 0; i < 60; ++i) {
      picture = noisy(grey, random, stated);
      smoothing(picture, i * frame_ns);
    }
    const double share = 1 - std::exp(-0.1);
    // 4096 pixels know a standard deviation to 1.1 %; five times that.
    EXPECT_NEAR(deviation(picture, 1) / (pixel_sigma * std::sqrt(share / (2 - share))), 1, 0.06);
    EXPECT_NEAR(
        picture.variance[0].g / (stated * stated * pixel_sigma * pixel_sigma * share / (2 - share)),
        1, 0.01);
  }
}

TEST(Smoothing, OfNoSecondsPassesEverything) {
  std::mt19937 random(2);
  Smoothing smoothing(0);
  for (int i = 0; i < 3; ++i) {
    HdrPicture picture = noisy(grey, random);
    const auto before = picture.radiance;
    smoothing(picture, i * frame_ns);
    EXPECT_EQ(picture.radiance, before);
  }
}

// The lamp is far above the noise in its own pixels; on the wall around it leaves 2
// standard deviations, which no single pixel tells from noise.
TEST(Smoothing, ASwitchedLightPassesAtOnceAndSoDoesWhatItLeavesOnTheWalls) {
  std::mt19937 random(3);
  const auto lit = [](int p) {
    return p % picture_side < 4 && p / picture_side < 4 ? 50.0f : 1 + 2 * pixel_sigma;
  };
  for (const bool on : {false, true}) {
    Smoothing smoothing(5);
    HdrPicture picture;
    for (int i = 0; i < 40; ++i) {
      picture = on ? noisy(grey, random) : noisy(lit, random);
      smoothing(picture, i * frame_ns);
    }
    picture = on ? noisy(lit, random) : noisy(grey, random);
    const double raw = sum_of(picture);
    smoothing(picture, 40 * frame_ns);
    // The walls' change is this sum; what lags are squares whose own change is within the noise.
    EXPECT_NEAR(sum_of(picture), raw, 0.05 * 2 * pixel_sigma * picture_pixels) << on;
    for (int p = 0; p < 4; ++p) EXPECT_NEAR(picture.radiance[p].g, on ? 50 : 1, 6 * pixel_sigma);
  }
}

// Something that passes in front of a part of the picture leaves the rest averaged.
TEST(Smoothing, WhatChangesByItselfLeavesTheRestAveraged) {
  std::mt19937 random(4);
  Smoothing smoothing(0.4);
  HdrPicture picture;
  for (int i = 0; i < 60; ++i) {
    picture = noisy([i](int p) { return p / picture_side < 8 ? static_cast<float>(i % 7) : 1.0f; },
                    random);
    smoothing(picture, i * frame_ns);
  }
  double squares = 0;
  int rest = 0;
  for (int p = 16 * picture_side; p < picture_pixels; ++p, ++rest)
    squares += std::pow(picture.radiance[static_cast<std::size_t>(p)].g - 1, 2);
  EXPECT_LT(std::sqrt(squares / rest), 0.3 * pixel_sigma);  // 0.22 where nothing starts anew
  for (int p = 0; p < 8 * picture_side; ++p)
    EXPECT_NEAR(picture.radiance[static_cast<std::size_t>(p)].g, 59 % 7, 6 * pixel_sigma);
}

TEST(Smoothing, APictureOfAnotherSizeStartsAnew) {
  std::mt19937 random(6);
  Smoothing smoothing(10);
  HdrPicture picture = noisy(grey, random);
  smoothing(picture, 0);
  HdrPicture small{1, 1, {glm::vec3(3)}, {0}, {glm::vec3(1)}};
  smoothing(small, frame_ns);
  EXPECT_EQ(small.radiance[0], glm::vec3(3));
}

}  // namespace previz::lighting::smoothing_test
