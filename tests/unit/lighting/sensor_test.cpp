// What lens and sensor do to a picture besides the response, and what is done where it clips.
#include "daemon/core/lighting/expansion.hpp"
#include "daemon/core/lighting/lighting.hpp"
#include "tests/support/lighting_pictures.hpp"
#include "tests/support/test.hpp"

namespace previz::lighting::sensor_test {

using test::degree;

TEST(Vignetting, LeastIlluminationIsTheLeastOfManyAngles) {
  for (const Vignetting& v : {Vignetting{}, Vignetting{-0.1, 0, 0}, Vignetting{-0.4, 0.1, 0},
                              Vignetting{-0.5, 0.2, -0.03}, Vignetting{0.3, -0.5, 0.15},
                              Vignetting{0, 0, -0.02}, Vignetting{0, -0.1, 0.03}}) {
    for (const double end : {0.5, 1.2, 1.8}) {
      double least = 1;
      for (int i = 0; i <= 10000; ++i)
        least = std::min(least, relative_illumination(v, end * i / 10000));
      EXPECT_NEAR(least_illumination(v, end), least, 1e-6) << v[0] << " " << v[1] << " " << v[2];
    }
  }
}

// A lens that darkens towards its edge, a sensor that shows light in the dark: the sky as it is.
TEST(Estimate, UndoesVignettingAndDarkLevel) {
  LightCameraCalibration camera = test::fisheye_camera(128, test::looking(30, 90));
  camera.vignetting = {-0.12, 0.01, -0.002};
  camera.dark_level = {0.03, 0.02, 0.04};
  const glm::dvec3 radiance(1, 2, 3);
  const double exposure = 0.25;
  const Fisheye lens(camera.intrinsics);
  const FramePtr frame = test::make_frame(128, 128, exposure, [&](int x, int y) {
    const auto ray = lens.unproject({x, y});
    const double falloff =
        ray ? relative_illumination(camera.vignetting, std::acos(glm::normalize(*ray).z)) : 0;
    return exposure * falloff * radiance + camera.dark_level;
  });
  const Lighting lighting = estimate({&frame, 1}, camera, {});
  for (const glm::vec3& texel : lighting.environment.radiance)  // half a code is 3e-5
    ASSERT_LT(glm::length(glm::dvec3(texel) - radiance), 3e-4);
  EXPECT_EQ(lighting.report.underexposed_sr, 0);
}

HdrPicture clipped_square(int size, int side) {
  const auto pixels = static_cast<std::size_t>(size * size);
  HdrPicture picture{size,
                     size,
                     std::vector<glm::vec3>(pixels, glm::vec3(0.2f)),
                     std::vector<std::uint8_t>(pixels),
                     {}};
  for (int y = 8; y < 8 + side; ++y)
    for (int x = 8; x < 8 + side; ++x) {
      picture.radiance[static_cast<std::size_t>(y * size + x)] = glm::vec3(2, 2, 1);
      picture.flags[static_cast<std::size_t>(y * size + x)] = overexposed;
    }
  return picture;
}

TEST(ExpandClipped, IsBoundedKeepsColourAndTouchesNothingElse) {
  for (const int side : {1, 3, 12}) {
    const HdrPicture before = clipped_square(32, side);
    HdrPicture picture = before;
    expand_clipped(picture, 8);
    float largest = 0;
    for (std::size_t p = 0; p < picture.radiance.size(); ++p) {
      if (!picture.flags[p]) {
        EXPECT_EQ(picture.radiance[p], before.radiance[p]);
        continue;
      }
      const glm::vec3 times = picture.radiance[p] / before.radiance[p];
      EXPECT_FLOAT_EQ(times.r, times.b);
      EXPECT_GE(times.r, 1);
      EXPECT_LE(times.r, 8 * (1 + 1e-6f));
      largest = std::max(largest, times.r);
    }
    // All of the filter inside; its 3x3 core, (14/16)^2; its middle, (6/16)^2.
    const double share = side == 12 ? 1 : side == 3 ? 196.0 / 256 : 36.0 / 256;
    EXPECT_NEAR(largest, 1 + 7 * share, 1e-5) << side;
  }
}

// P5: one exposure only, a lamp that clips it; the report says how much the light is a guess.
TEST(Estimate, ExpandsWhatOneExposureClipsAndSaysSo) {
  const LightCameraCalibration camera = test::fisheye_camera(256, test::looking(0, 90));
  const glm::dvec3 lamp = test::towards(0, 60);
  constexpr double radius = 6 * degree, white = 1;
  const test::Sky sky = [&](const glm::dvec3& d) {
    return glm::dvec3(glm::dot(d, lamp) > std::cos(radius) ? 20.0 : 0.1);
  };
  const FramePtr frame = test::photograph(camera, sky, 1);
  const double lamp_sr = 2 * std::numbers::pi * (1 - std::cos(radius));
  const auto flux_with = [&](double gain) {
    set::Lighting settings;
    settings.clipped_gain = gain;
    const Lighting lighting = estimate({&frame, 1}, camera, settings);
    EXPECT_NEAR(lighting.report.overexposed_sr / lamp_sr, 1, 0.15);  // a pixel's rim
    EXPECT_THAT(lighting.report.notes[0],
                HasSubstr(gain > 1 ? "up to 20 times white" : "a lower bound"));
    return total_flux(lighting.environment).g;
  };
  // The rim of two pixels of 0.75 degrees is expanded less: of a lamp of 6 degrees 0.44 of its area
  // is that rim, at three quarters on average.
  const double added = flux_with(20) - flux_with(1);
  EXPECT_LT(added, 19 * white * lamp_sr * 1.15);
  EXPECT_GT(added, 19 * white * lamp_sr * 0.75);
}

}  // namespace previz::lighting::sensor_test
