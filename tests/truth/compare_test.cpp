// The measures on constructed pictures whose answers are known.
#include "tests/truth/compare.hpp"
#include "tests/support/test.hpp"

#include "daemon/core/lighting/response.hpp"
#include "drivers/plate.hpp"

namespace previz::truth::compare_test {

// 32x24: 4x3 blocks. The mask covers x >= 20: block columns 0 and 1 are uncovered, 2 is the edge,
// 3 is covered. Lr = 0.2; where uncovered Lm = 0.1 (D = -0.1), where covered Lm = 0.4.
TruthFrame constructed() {
  TruthFrame t;
  t.width = 32;
  t.height = 24;
  t.exposure = 1.25;  // white at 0.8
  t.response.kind = ResponseCurve::Kind::srgb;
  t.plate = t.real = render::Sheet<glm::vec3>(32 * 24, glm::vec3(0.2F));
  for (int i = 0; i < 32 * 24; ++i) {
    const bool covered = i % 32 >= 20;
    t.mixed.emplace_back(covered ? 0.4F : 0.1F);
    t.mask.push_back(covered ? 1.0F : 0.0F);
  }
  return t;
}

EstimatedFrame perfect(const TruthFrame& t) {
  EstimatedFrame e;
  e.composite = ideal_composite(t);
  e.mixed = t.mixed;
  e.real = t.real;
  e.mask = t.mask;
  for (std::size_t i = 0; i < t.mixed.size(); ++i) e.diff.push_back(t.mixed[i] - t.real[i]);
  e.picture = displayed(e.composite, t.width, t.height, t.exposure, t.response);
  return e;
}

TEST(Compare, PerfectEstimateHasNoError) {
  const TruthFrame t = constructed();
  const Measures m = compare(t, perfect(t));
  EXPECT_EQ(m.diff_blocks, 6);
  EXPECT_EQ(m.virtual_blocks, 3);
  EXPECT_EQ(m.edge_blocks, 3);
  EXPECT_LT(m.e_diff, 1e-6);
  EXPECT_EQ(m.e_virtual, 0);
  EXPECT_EQ(m.e_edge, 0);
  EXPECT_EQ(m.e_real, 0);
  EXPECT_EQ(m.e_mask, 0);
  EXPECT_EQ(m.e_mask_edge, 0);
  EXPECT_EQ(m.psnr, identical_psnr);
  EXPECT_NEAR(m.ssim, 1, 1e-12);
  EXPECT_FALSE(m.noise_diff);
}

TEST(Compare, ErrorsAreRelativeToTheSignalOfTheirBlocks) {
  const TruthFrame t = constructed();
  EstimatedFrame e = perfect(t);
  for (auto& value : e.diff) value *= 1.1F;                     // -0.11 instead of -0.10
  for (auto& value : e.mixed) value += glm::vec3(0.02F, 0, 0);  // 0.02 of 0.4 in one channel of 3
  const Measures m = compare(t, e);
  EXPECT_NEAR(m.e_diff, 0.1, 1e-5);
  EXPECT_NEAR(m.bias_diff, 0.1, 1e-5);
  EXPECT_NEAR(m.e_virtual, 0.05 / std::sqrt(3.0), 1e-6);
  EXPECT_NEAR(m.bias_virtual, 0.05 / 3, 1e-6);
}

TEST(Compare, EverythingIsClippedAtTheSensorsWhite) {
  TruthFrame t = constructed();
  // A lamp's mirror image, and D = 0.8 - 0.2.
  for (std::size_t i = 0; i < t.mixed.size(); ++i)
    t.mixed[i] = glm::vec3(t.mask[i] == 1 ? 50 : 1000);
  EstimatedFrame e = perfect(t);
  for (auto& value : e.mixed) value *= 3.0F;
  for (auto& value : e.diff) value *= 0.5F;
  const Measures m = compare(t, e);
  EXPECT_EQ(m.e_virtual, 0);
  EXPECT_LT(m.e_diff, 1e-6);
}

TEST(Compare, MaskErrorsOverAllAndNearTheEdge) {
  const TruthFrame t = constructed();
  EstimatedFrame e = perfect(t);
  // Column 19 half covered: 1/64 of all pixels. Edge pixels are columns 19 and 20; within 2 of them
  // 17..22, six columns.
  for (int y = 0; y < t.height; ++y) e.mask[static_cast<std::size_t>(y * t.width + 19)] = 0.5F;
  const Measures m = compare(t, e);
  EXPECT_NEAR(m.e_mask, 0.5 / 32, 1e-9);
  EXPECT_NEAR(m.e_mask_edge, 0.5 / 6, 1e-9);
}

TEST(Compare, EdgeBlocksJudgeTheComposite) {
  const TruthFrame t = constructed();
  EstimatedFrame e = perfect(t);
  // Block column 2: x 16..19 show 0.2 - 0.1 = 0.1, x 20..23 show 0.4; block mean 0.25.
  for (auto& value : e.composite) value += 0.025F;
  EXPECT_NEAR(compare(t, e).e_edge, 0.1, 1e-6);
}

TEST(Compare, NoiseIsThatOfAPixelOverEightAndTheSignal) {
  TruthFrame t = constructed();
  t.diff_rmse = 0.004;
  t.mixed_rmse_of_mean = 0.016;
  const Measures m = compare(t, perfect(t));
  const double picture_mean = (20 * 0.1 + 12 * 0.4) / 32;
  EXPECT_NEAR(m.noise_diff.value(), 0.004 / 8 / 0.1, 1e-7);
  EXPECT_NEAR(m.noise_virtual.value(), 0.016 * picture_mean / 8 / 0.4, 1e-7);
}

TEST(Compare, IdealCompositeKeepsThePlateWhereNothingChanges) {
  TruthFrame t = constructed();
  const lighting::Response curve(t.response, 8);
  Plate plate = displayed(t.plate, t.width, t.height, t.exposure, t.response);
  for (std::size_t i = 0; i < plate.samples.size(); ++i) {
    plate.samples[i] = static_cast<std::uint16_t>(i % 256);
    t.plate[i / 3][static_cast<int>(i % 3)] =
        static_cast<float>(curve.inverse()[i % 256] / t.exposure);
  }
  t.mixed = t.real;
  t.mask.assign(t.mask.size(), 0);
  const Plate shown = displayed(ideal_composite(t), t.width, t.height, t.exposure, t.response);
  EXPECT_EQ(shown.samples, plate.samples);
}

TEST(Compare, WhatACompositeShowsIsMeasuredInPlaceOfItsLayers) {
  TruthFrame t = constructed();
  t.mask[0] = 0.5F;
  EstimatedFrame e = perfect(t);
  const glm::vec3 partly_diff = e.diff[0], partly_mixed = e.mixed[0];
  for (glm::vec3& pixel : e.composite) pixel += 0.01F;
  const EstimatedFrame shown = as_composited(t.plate, e);
  const auto covered = static_cast<std::size_t>(t.width - 1);
  EXPECT_EQ(shown.diff[0], partly_diff);
  EXPECT_EQ(shown.mixed[0], partly_mixed);
  EXPECT_NEAR(shown.diff[1].r, -0.1 + 0.01, 1e-6);
  EXPECT_EQ(shown.mixed[1], e.mixed[1]);
  EXPECT_NEAR(shown.mixed[covered].r, 0.4 + 0.01, 1e-6);
  EXPECT_EQ(shown.diff[covered], e.diff[covered]);
  EXPECT_EQ(as_composited({}, e).diff[1], e.composite[1]);
}

TEST(Compare, RefusesPicturesThatDoNotFit) {
  const TruthFrame t = constructed();
  EstimatedFrame e = perfect(t);
  e.diff.pop_back();
  EXPECT_THROW(compare(t, e), Error);
  const Plate small{10, 10, 8, std::vector<std::uint16_t>(300)};
  EXPECT_THROW(ssim(small, small), Error);
}

TEST(Compare, PsnrOfAKnownDifference) {
  Plate a{16, 16, 8, std::vector<std::uint16_t>(16 * 16 * 3, 100)};
  Plate b = a;
  for (auto& sample : b.samples) sample = 105;
  EXPECT_NEAR(psnr(a, b), 10 * std::log10(255.0 * 255.0 / 25.0), 1e-12);
}

TEST(Compare, SsimOfConstantAndNegatedPictures) {
  Plate a{24, 24, 8, std::vector<std::uint16_t>(24 * 24 * 3, 100)};
  Plate b = a;
  for (auto& sample : b.samples) sample = 120;
  // No variance: only the luminance term is left.
  const double c1 = 2.55 * 2.55;
  EXPECT_NEAR(ssim(a, b), (2 * 100.0 * 120 + c1) / (100.0 * 100 + 120 * 120 + c1), 1e-9);
  // A negated picture about its mean has covariance -variance.
  for (std::size_t i = 0; i < a.samples.size(); ++i) {
    a.samples[i] = static_cast<std::uint16_t>(i / 3 % 2 ? 140 : 100);
    b.samples[i] = static_cast<std::uint16_t>(i / 3 % 2 ? 100 : 140);
  }
  EXPECT_LT(ssim(a, b), -0.7);
  EXPECT_NEAR(ssim(a, a), 1, 1e-12);
}

TEST(Bounds, AllowTheTruthsNoiseAndNameWhatIsViolated) {
  Measures m;
  m.e_diff = 0.065;
  m.noise_diff = 0.03;  // sqrt(0.06^2 + 0.03^2) = 0.067
  m.e_virtual = 0.029;
  m.e_edge = 0.031;
  m.e_mask = 0.001;
  m.psnr = 41;
  m.ssim = 0.97;
  const auto wrong = violations(m, bounds_named("paired"));
  ASSERT_EQ(wrong.size(), 2u);
  EXPECT_EQ(wrong[0], "e_edge is 0.031, at most 0.03 is allowed");
  EXPECT_EQ(wrong[1], "ssim is 0.97, at least 0.98 is allowed");
  m.e_mask_edge = 0.05;
  EXPECT_EQ(violations(m, bounds_named("paired")).size(), 3u);
  m.e_diff = std::nan("");
  EXPECT_EQ(violations(m, bounds_named("paired")).size(), 4u);
  EXPECT_THROW(bounds_named("loose"), Error);
}

}  // namespace previz::truth::compare_test
