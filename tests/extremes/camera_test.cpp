// Pixels at the ends of the sensor's codes, both ways; brackets that are clipped or black in every
// exposure.
#include "daemon/core/lighting/hdr.hpp"
#include "daemon/core/lighting/lighting.hpp"
#include "daemon/core/lighting/response.hpp"
#include "tests/support/lighting.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/pixels_by_hand.hpp"

namespace previz::lighting::camera_test {

using test::fisheye_camera;
using test::looking;
using test::make_frame;

const ResponseCurve curves[] = {
    {},
    {.kind = ResponseCurve::Kind::linear, .inverse_table = {}},
    {.kind = ResponseCurve::Kind::gamma, .gamma = 2.2, .inverse_table = {}},
    {.kind = ResponseCurve::Kind::table, .inverse_table = {0, 0.01, 0.1, 0.4, 1}}};

LightCameraCalibration upward(LightCameraCalibration camera) {
  camera.world_from_camera = looking(0, 90);
  return camera;
}

// Every code of 8 bits, and the ends of 16, through radiance and back at any exposure: without a
// difference and with a covered pixel that shows the very radiance.
TEST(ExtremeCamera, EveryCodeComesBackThroughTheComposite) {
  render::Denoiser denoiser(*test::shared_device());
  for (const ResponseCurve& curve : curves) {
    for (const int bits : {8, 16}) {
      const int top = (1 << bits) - 1;
      Plate plate{256, 1, bits, {}};
      for (int i = 0; i < 256; ++i) {
        const int code = bits == 8 ? i : i < 128 ? i : top - (255 - i);
        plate.samples.insert(plate.samples.end(), 3, static_cast<std::uint16_t>(code));
      }
      const Response response(curve, bits);
      for (const double exposure : {1e-6, 0.85, 1e6}) {
        const render::PlateRadiance radiance = render::plate_radiance(plate, response, exposure);
        EXPECT_EQ(radiance.channel(0, 0).radiance, 0);
        EXPECT_DOUBLE_EQ(radiance.channel(255, 2).radiance, 1 / exposure);
        std::vector<gpu::GpuPixel> untouched(256), covered(256);
        for (std::size_t i = 0; i < 256; ++i) {
          untouched[i].square_high.w = covered[i].square_high.w = 1;
          const double value = radiance.channel(i, 0).radiance;
          const auto high = static_cast<float>(value);
          const auto low = static_cast<float>(value - static_cast<double>(high));
          covered[i].mixed_high = gpu::vec4(high, high, high, 1);
          covered[i].mixed_low = gpu::vec4(low, low, low, 0);
        }
        const auto shown = [&](const std::vector<gpu::GpuPixel>& pixels, bool denoise) {
          return test::present(pixels, plate, response, exposure, denoiser, denoise, 1).samples;
        };
        SCOPED_TRACE(std::to_string(bits) + " bits, exposure " + std::to_string(exposure));
        EXPECT_EQ(shown(untouched, false), plate.samples);
        EXPECT_EQ(shown(untouched, true), plate.samples);
        EXPECT_EQ(shown(covered, false), plate.samples);
      }
    }
  }
}

// A bracket of two stops, all white or all black: the map is finite and what the least or the most
// exposed frame can say, the report says over how much of the sky, and a note says it in words.
TEST(ExtremeCamera, AClippedOrBlackBracketIsFlagged) {
  const LightCameraCalibration camera = upward(fisheye_camera());
  for (const double signal : {0.0, 1.0}) {
    std::vector<FramePtr> bracket;
    for (const double exposure : {4.0, 1.0})
      bracket.push_back(
          make_frame(512, 512, exposure, std::vector<glm::dvec3>(512 * 512, glm::dvec3(signal))));
    const HdrPicture merged = merge_exposures(bracket, camera.response);
    for (const std::uint8_t flag : merged.flags)
      ASSERT_EQ(flag, signal > 0 ? overexposed : underexposed);
    const Lighting lighting = estimate(bracket, camera, {});
    for (const glm::vec3& radiance : lighting.environment.radiance)
      for (int c = 0; c < 3; ++c)
        ASSERT_NEAR(radiance[c], signal, 1e-4);  // white of the shorter exposure, and smooth
    const EnvironmentReport& report = lighting.report;
    EXPECT_NEAR(signal > 0 ? report.overexposed_sr : report.underexposed_sr, report.seen_sr, 1e-6);
    EXPECT_EQ(signal > 0 ? report.underexposed_sr : report.overexposed_sr, 0);
    ASSERT_FALSE(report.notes.empty());
    EXPECT_THAT(report.notes[0],
                HasSubstr(signal > 0 ? "clipped in every exposure" : "black in every exposure"));
  }
}

double cap_sr(double radius_rad) {
  return 2 * std::numbers::pi * (1 - std::cos(radius_rad));
}

// The disc of the sun, a million times its sky, which no bracket of a camera reaches: its flux is a
// lower bound of white over the pixels that it touches, reported with the solid angle and the
// exposure that would be needed, and its direction is right.
TEST(ExtremeCamera, ASunInFrameIsAToldLowerBoundInTheRightDirection) {
  const LightCameraCalibration camera = upward(fisheye_camera());
  set::Lighting settings;
  settings.resolution = 256;
  const glm::dvec3 sun = test::towards(40, 55);
  const double radius = 0.265 * test::degree, white = 256;
  const test::Sky sky = [&](const glm::dvec3& d) {
    return glm::dvec3(glm::dot(d, sun) > std::cos(radius) ? 1e6 : 1.0);
  };
  std::vector<FramePtr> bracket;
  for (const double exposure : {0.5, 1 / 16.0, 1 / white})
    bracket.push_back(test::photograph(camera, sky, exposure, test::Detail::fine));
  const Lighting lighting = estimate(bracket, camera, settings);
  const EnvironmentReport& report = lighting.report;
  const double pixel = 1 / camera.intrinsics.fx;
  EXPECT_GT(report.overexposed_sr, 0);
  EXPECT_LT(report.overexposed_sr, cap_sr(radius + std::sqrt(2.0) * pixel));
  ASSERT_FALSE(report.notes.empty());
  EXPECT_THAT(report.notes[0], HasSubstr("an exposure below 0.00391 is needed"));
  glm::dvec3 moment(0);
  for (int j = 0; j < lighting.environment.size; ++j) {
    for (int i = 0; i < lighting.environment.size; ++i) {
      const glm::vec3& r =
          lighting.environment
              .radiance[static_cast<std::size_t>(j * lighting.environment.size + i)];
      ASSERT_TRUE(r.g >= 0 && r.g <= white * (1 + 1e-6)) << r.g;
      if (r.g > 2)
        moment += (r.g - 1.0) * glm::dvec3(texel_direction(lighting.environment.size, i, j));
    }
  }
  // A clipped sun is known to the pixels that it clips, no better.
  EXPECT_LT(std::acos(glm::dot(glm::normalize(moment), sun)), pixel);
}

// A torch held into the lens, or a hand over it: the map is what can be said, the first note says
// that the camera is blinded.
TEST(ExtremeCamera, ABlindedCameraIsTold) {
  const LightCameraCalibration camera = upward(fisheye_camera(128));
  for (const double radiance : {1e5, 0.0}) {
    const test::Sky sky = [&](const glm::dvec3& d) {
      return glm::dvec3(d.z < 0.2 ? 0.5 : radiance);
    };
    std::vector<FramePtr> bracket;
    for (const double exposure : {1.0, 0.01})
      bracket.push_back(test::photograph(camera, sky, exposure));
    const Lighting lighting = estimate(bracket, camera, {});
    ASSERT_FALSE(lighting.report.notes.empty());
    EXPECT_THAT(lighting.report.notes[0], StartsWith("the light camera is blinded: "));
    for (const glm::vec3& r : lighting.environment.radiance)
      ASSERT_TRUE(r.g >= 0 && r.g <= 100 * (1 + 1e-6));
  }
}

// Stated two stops off, an exposure contradicts its neighbours all over: the note names both, the
// newest counts, and the scales are not mixed.
TEST(ExtremeCamera, AnExposureStatedTwoStopsWrongIsTold) {
  const LightCameraCalibration camera = upward(fisheye_camera(128));
  const test::Sky sky = [](const glm::dvec3& d) { return glm::dvec3(0.4 + 0.3 * d.z); };
  std::vector<FramePtr> bracket;
  for (int i = 0; i < 2; ++i) {
    const double exposure = i == 0 ? 0.25 : 1.0;
    Frame frame = *test::photograph(camera, sky, exposure);
    frame.exposure = i == 0 ? 4 * exposure : exposure;
    frame.sequence = static_cast<std::uint64_t>(i);
    bracket.push_back(std::make_shared<Frame>(std::move(frame)));
  }
  const Lighting lighting = estimate(bracket, camera, {});
  ASSERT_THAT(lighting.report.notes, Contains(HasSubstr("disagree by 2.0 stops")));
  const auto up = texel_index(lighting.environment.size, glm::vec3(0, 0, 1));
  EXPECT_NEAR(lighting.environment.radiance[up].g, 0.7, 0.005);
}

}  // namespace previz::lighting::camera_test
