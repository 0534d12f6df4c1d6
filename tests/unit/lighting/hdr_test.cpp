#include "daemon/core/lighting/hdr.hpp"

#include "daemon/core/lighting/response.hpp"
#include "tests/support/lighting.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/test.hpp"

namespace previz::lighting::hdr_test {

using test::make_frame;
using test::rgb8_frame;

const ResponseCurve linear{
    .kind = ResponseCurve::Kind::linear, .inverse_table = {}, .clip_share = 1};
const ResponseCurve srgb = LightCameraCalibration{}.response;

// The signals of a sensor that saturates at this share of white.
FramePtr saturated_frame(double exposure, const std::vector<glm::dvec3>& radiances, double share) {
  std::vector<glm::dvec3> signals;
  for (const glm::dvec3& radiance : radiances)
    signals.push_back(glm::min(exposure * radiance, glm::dvec3(share)));
  return make_frame(static_cast<int>(radiances.size()), 1, exposure, signals);
}

FramePtr frame_of(double exposure, const std::vector<glm::dvec3>& radiances) {
  return saturated_frame(exposure, radiances, 1);
}

TEST(MergeExposures, OneExposureIsTheInverseResponse) {
  std::vector<std::uint8_t> codes;
  for (int code = 0; code < 255; ++code) codes.insert(codes.end(), 3, static_cast<uint8_t>(code));
  const FramePtr frame = rgb8_frame(255, 0.5, codes);
  const HdrPicture picture = merge_exposures({&frame, 1}, srgb);
  const Response response({}, 8);
  for (std::size_t code = 0; code < 255; ++code) {
    EXPECT_FLOAT_EQ(picture.radiance[code].g, static_cast<float>(response.inverse()[code] / 0.5));
    EXPECT_EQ(picture.flags[code], code == 0 ? underexposed : 0);
  }
}

TEST(MergeExposures, KeepsExactRadianceOverSevenDecades) {
  const std::vector<glm::dvec3> radiances{
      {1e-3, 1e-2, 0.1}, {1, 10, 100}, {1000, 5, 0.02}, {3, 3, 3000}};
  std::vector<FramePtr> frames;
  for (double exposure : {1e-4, 1e-2, 1.0, 100.0}) frames.push_back(frame_of(exposure, radiances));
  std::mt19937 random(1);
  for (int order = 0; order < 5; ++order) {
    std::shuffle(frames.begin(), frames.end(), random);
    const HdrPicture picture = merge_exposures(frames, linear);
    for (std::size_t p = 0; p < radiances.size(); ++p) {
      EXPECT_EQ(picture.flags[p], 0);
      // Every radiance lies above 1 % of white in some exposure; half a code there is 0.08 %, and
      // no exposure counts that is much worse.
      for (int c = 0; c < 3; ++c)
        EXPECT_NEAR(picture.radiance[p][c] / radiances[p][c], 1, 1e-3) << "pixel " << p;
    }
  }
}

TEST(MergeExposures, FlagsWhatNoExposureSaw) {
  const std::vector<glm::dvec3> radiances{{0, 0, 0}, {50, 1, 1}, {0, 0, 1}, {50, 50, 50}};
  const std::vector<FramePtr> frames{frame_of(1, radiances), frame_of(0.1, radiances)};
  const HdrPicture picture = merge_exposures(frames, linear);
  EXPECT_EQ(picture.flags, (std::vector<std::uint8_t>{underexposed, overexposed, 0, overexposed}));
  EXPECT_EQ(picture.radiance[0], glm::vec3(0));
  EXPECT_FLOAT_EQ(picture.radiance[1].r, 10);  // white of the shortest exposure
  EXPECT_NEAR(picture.radiance[1].g, 1, 1e-3);
  EXPECT_EQ(picture.radiance[2].r, 0);
  EXPECT_FLOAT_EQ(picture.radiance[3].b, 10);
}

TEST(MergeExposures, AClippedChannelLeavesTheOthers) {
  const std::vector<glm::dvec3> radiances{{5, 0.5, 0.25}};
  const std::vector<FramePtr> frames{frame_of(1, radiances), frame_of(0.01, radiances)};
  const HdrPicture picture = merge_exposures(frames, linear);
  EXPECT_EQ(picture.flags[0], 0);
  EXPECT_NEAR(picture.radiance[0].r, 5, 5e-3);    // half a code of 0.05
  EXPECT_NEAR(picture.radiance[0].g, 0.5, 2e-5);  // the long exposure rules
  EXPECT_NEAR(picture.radiance[0].b, 0.25, 2e-5);
}

// A wall that the longest exposure shows, a lamp that only the shortest does, and one that none
// does. In every order, since the newest exposure is believed.
TEST(MergeExposures, WhatIsClippedBelowWhiteIsAtLeastSoMuchLight) {
  constexpr double share = 0.93, wall = 0.3, light = 100, brightest = 1e4;
  const std::vector<glm::dvec3> radiances{glm::dvec3(wall), glm::dvec3(light),
                                          glm::dvec3(brightest)};
  std::vector<double> exposures{1.0 / 256, 1.0 / 16, 1.0};
  ResponseCurve measured = linear;
  measured.clip_share = share;
  constexpr double half_a_code = 0.5 / 65535;
  do {
    std::vector<FramePtr> frames;
    for (const double exposure : exposures)
      frames.push_back(saturated_frame(exposure, radiances, share));
    const HdrPicture picture = merge_exposures(frames, measured);
    EXPECT_EQ(picture.flags, (std::vector<std::uint8_t>{0, 0, overexposed}));
    // By the shortest exposure alone, whose code for the lamp is a half off at most.
    EXPECT_NEAR(picture.radiance[1].g, light, 256 * half_a_code + 1e-6 * light);
    // The longest exposure weighs most, and each is right to half a code of its own.
    EXPECT_NEAR(picture.radiance[0].g, wall, 256 * half_a_code);
    EXPECT_NEAR(picture.radiance[2].g, share * 256, 256 * half_a_code + 1e-6 * share * 256);
  } while (std::next_permutation(exposures.begin(), exposures.end()));
}

// A sensor whose dark level is all that it does not clip would see no light.
TEST(MergeExposures, ADarkLevelAtWhatIsClippedIsRefused) {
  ResponseCurve half = linear;
  half.clip_share = 0.5;
  const FramePtr frame = frame_of(1, {glm::dvec3(0.3)});
  EXPECT_NO_THROW(Bracket({&frame, 1}, half, glm::dvec3(0.4)));
  const std::string refusal = test::error_of([&] {
    const Bracket refused({&frame, 1}, half, glm::dvec3(0, 0, 0.501));
  });
  EXPECT_THAT(refusal, HasSubstr("dark_level is 0.501"));
}

// Without a share that was measured, only the largest code is clipped, whatever the depth.
TEST(MergeExposures, OnlyTheLargestCodeIsClippedUnlessTheCalibrationSaysOtherwise) {
  for (const int bits : {1, 8, 10, 12, 16})
    EXPECT_EQ(Response(srgb, bits).clipping().at, (1u << bits) - 1) << bits;
  const FramePtr frame = rgb8_frame(2, 1, {254, 254, 254, 255, 255, 255});
  EXPECT_EQ(merge_exposures({&frame, 1}, srgb).flags, (std::vector<std::uint8_t>{0, overexposed}));
}

// Within what noise and calibration allow; what lies beyond is another test's.
TEST(MergeExposures, EqualExposuresAverage) {
  const std::vector<FramePtr> frames{make_frame(1, 1, 2, {{0.20, 0.4, 0.52}}),
                                     make_frame(1, 1, 2, {{0.21, 0.4, 0.5}})};
  const HdrPicture picture = merge_exposures(frames, linear);
  EXPECT_NEAR(picture.radiance[0].r, 0.1025, 1e-5);
  EXPECT_NEAR(picture.radiance[0].g, 0.2, 1e-5);
  EXPECT_NEAR(picture.radiance[0].b, 0.255, 1e-5);
  EXPECT_EQ(picture.flags[0], 0);
}

// The truth sets' light camera: 8-bit sRGB, 60000 electrons, 8 electrons read noise.
TEST(MergeExposures, IsUnbiasedAndNearTheBestUnderSensorNoise) {
  constexpr int pixels = 20000;
  const std::vector<double> exposures{0.8 / 4096, 0.8 / 256, 0.8 / 16, 0.2, 0.8, 3.2};
  const Response response({}, 8);
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (int level = 0; level < 28; ++level) {
    const double radiance = 2e-3 * std::pow(1.7, level);  // to 3300
    std::vector<FramePtr> frames;
    double best = 0;  // information of all exposures that are neither black nor clipped
    for (double exposure : exposures) {
      const double signal = radiance * exposure;
      const double sigma = std::sqrt(signal / 60000 + std::pow(8.0 / 60000, 2));
      std::vector<std::uint8_t> codes;
      for (int i = 0; i < pixels; ++i)
        codes.insert(codes.end(), 3,
                     static_cast<std::uint8_t>(response.forward(signal + sigma * normal(random))));
      frames.push_back(rgb8_frame(pixels, exposure, codes));
      const int code = response.forward(signal);
      if (code > 1 && code < 250) {
        const double step = response.inverse()[static_cast<std::size_t>(code + 1)] -
                            response.inverse()[static_cast<std::size_t>(code)];
        best += exposure * exposure / (sigma * sigma + step * step / 12);
      }
    }
    const HdrPicture picture = merge_exposures(frames, srgb);
    double sum = 0, squares = 0;
    for (const glm::vec3& r : picture.radiance) {
      sum += r.g;
      squares += std::pow(r.g - radiance, 2);
    }
    const double bias = sum / pixels / radiance - 1;
    const double rms = std::sqrt(squares / pixels) / radiance;
    RecordProperty("radiance", std::to_string(radiance));
    // Noise of the mean is below rms / 140. Where one exposure alone counts and its noise is
    // smaller than its steps, rounding is not averaged out: half a step is the bound.
    const double half_step = 0.5 * std::sqrt(12 / best) / radiance;
    EXPECT_LT(std::abs(bias), std::max(0.002, half_step)) << "radiance " << radiance;
    EXPECT_LT(rms, 2 * std::sqrt(1 / best) / radiance) << "radiance " << radiance;
    EXPECT_EQ(picture.flags[0], 0) << "radiance " << radiance;
  }
}

std::string merge_error(const std::vector<FramePtr>& frames) {
  return test::error_of([&] { merge_exposures(frames, srgb); });
}

TEST(MergeExposures, RefusesWhatCannotBeUsed) {
  EXPECT_THAT(merge_error({}), HasSubstr("at least one"));
  EXPECT_THAT(merge_error({rgb8_frame(1, 0, {1, 2, 3})}), HasSubstr("light frame 12: exposure"));
  EXPECT_THAT(merge_error({rgb8_frame(1, std::nan(""), {1, 2, 3})}), HasSubstr("exposure"));
  EXPECT_THAT(merge_error({rgb8_frame(1, 1, {1, 2, 3}), rgb8_frame(2, 1, {1, 2, 3, 1, 2, 3})}),
              HasSubstr("2x1"));
}

}  // namespace previz::lighting::hdr_test
