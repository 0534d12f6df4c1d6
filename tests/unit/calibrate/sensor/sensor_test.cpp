// Dark level and vignetting of the light camera, from pictures made by code.
#include "daemon/tools/calibrate/sensor/dark_fit.hpp"
#include "daemon/tools/calibrate/sensor/vignetting_fit.hpp"
#include "drivers/calibration/fisheye.hpp"
#include "tests/support/calibrate_pictures.hpp"
#include "tests/support/lighting_pictures.hpp"

namespace previz::calibrate::sensor_test {

using test::degree;
using test::Pictures;

constexpr int size = 128;
constexpr int pictures = 8;
constexpr double noise = 0.002;
const glm::dvec3 level(0.010, 0.012, 0.015);

const ResponseCurve linear{.kind = ResponseCurve::Kind::linear, .inverse_table = {}};

// A covered lens; `leak` is added in a corner, every 1000th pixel is hot.
Pictures dark_pictures(double leak, double add = 0) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0, noise);
  std::vector<FramePtr> frames;
  for (int i = 0; i < pictures; ++i)
    frames.push_back(test::make_frame(size, size, 1, [&](int x, int y) {
      glm::dvec3 signal = level + add;
      for (int c = 0; c < 3; ++c) signal[c] += normal(random);
      if ((y * size + x) % 1000 == 0) signal.g = 0.9;
      if (x < size / 4 && y < size / 4) signal += leak;
      return signal;
    }));
  return Pictures(std::move(frames));
}

TEST(DarkFit, LevelNoiseAndHotPixelsAreFound) {
  Pictures source = dark_pictures(0);
  const DarkFit fit = fit_dark(source, linear);
  EXPECT_EQ(fit.pictures, pictures);
  EXPECT_EQ(fit.hot_pixels, static_cast<std::size_t>(size * size / 1000 + 1));
  // The mean of n pixels of all pictures: five standard errors; of its deviation likewise, which
  // has a relative one of 1 / sqrt(2 n).
  const double samples = 1.0 * pictures * size * size;
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(fit.level[c], level[c], 5 * noise / std::sqrt(samples));
    EXPECT_NEAR(fit.noise[c] / noise, 1, 5 / std::sqrt(2 * samples));
  }
}

TEST(DarkFit, ALensThatIsNotCoveredIsRefused) {
  Pictures leaking = dark_pictures(0.01);
  EXPECT_THROW(fit_dark(leaking, linear), Error);
  Pictures bright = dark_pictures(0, 0.6);
  EXPECT_THROW(fit_dark(bright, linear), Error);
  Pictures none({});
  EXPECT_THROW(fit_dark(none, linear), Error);
}

const Vignetting lens_loss = {-0.12, 0.015, -0.004};

LightCameraCalibration camera() {
  LightCameraCalibration camera = test::fisheye_camera(256);
  camera.dark_level = {0.01, 0.02, 0.015};
  return camera;
}

// Something evenly lit but for a gradient across the picture, seen through the lens by a sensor
// that shows no more than `most`.
FramePtr flat_picture(double brightness, const glm::dvec2& gradient, const Vignetting& loss,
                      double most = 1) {
  const LightCameraCalibration lens_of = camera();
  const Fisheye lens(lens_of.intrinsics);
  return test::make_frame(256, 256, 1, [&](int x, int y) {
    const auto ray = lens.unproject({x, y});
    double light = 0;
    if (ray)
      light = brightness * (1 + gradient.x * ray->x + gradient.y * ray->y) *
              relative_illumination(loss, std::acos(std::min(ray->z, 1.0)));
    return glm::min(light * glm::dvec3(1, 0.8, 0.6) + lens_of.dark_level, glm::dvec3(most));
  });
}

struct Flats {
  std::vector<FlatPicture> pictures;
  std::vector<std::string> notes;
};

Flats read_flats(std::vector<FramePtr> frames, const LightCameraCalibration& by = camera()) {
  Pictures source(std::move(frames));
  Flats flats;
  flats.pictures = read_flat_pictures(source, by, flats.notes);
  return flats;
}

TEST(VignettingFit, TheLensIsToldFromTheLight) {
  Flats flats = read_flats({flat_picture(0.6, {0.2, -0.1}, lens_loss),
                            flat_picture(0.4, {-0.3, 0}, lens_loss),
                            flat_picture(0.5, {0, 0.25}, lens_loss)});
  EXPECT_THAT(flats.notes, IsEmpty());
  const VignettingFit fit = fit_vignetting(flats.pictures, camera().intrinsics.max_angle_rad);
  // What the codes of 16 bits leave: half a code of the dimmest pixel's signal.
  const double rounding = 0.5 / 65535 / 0.1;
  EXPECT_LT(fit.rms, rounding);
  EXPECT_GT(fit.widest_rad, 97 * degree);
  for (int angle = 0; angle <= 100; angle += 10)
    EXPECT_NEAR(relative_illumination(fit.vignetting, angle * degree),
                relative_illumination(lens_loss, angle * degree), rounding)
        << angle;
}

// The middle of the picture is clipped at half of white, as the calibration says. What is left
// shows the lens, to half a code in each of three channels.
TEST(VignettingFit, WhatIsClippedBelowWhiteIsLeftOut) {
  constexpr double brightness = 0.52;
  LightCameraCalibration clips = camera();
  clips.response.clip_share = 0.5;
  const Flats flats = read_flats({flat_picture(brightness, {}, lens_loss, 0.5)}, clips);
  EXPECT_THAT(flats.notes, IsEmpty());
  ASSERT_EQ(flats.pictures.size(), 1u);
  for (const FlatSample& sample : flats.pictures[0].samples)
    ASSERT_NEAR(sample.signal,
                brightness * (1 + 0.8 + 0.6) * relative_illumination(lens_loss, sample.angle_rad),
                3 * 0.5 / 65535)
        << sample.angle_rad;
}

TEST(VignettingFit, PicturesThatCannotBeUsedAreLeftOutAndTold) {
  std::vector<glm::dvec3> signals(64 * 64, glm::dvec3(0.5));
  Flats flats = read_flats({test::make_frame(64, 64, 1, signals), flat_picture(5, {}, {})});
  EXPECT_THAT(flats.notes, ElementsAre(HasSubstr("64x64"), HasSubstr("black or white")));
  EXPECT_THROW(fit_vignetting(flats.pictures, 1), Error);
}

TEST(VignettingFit, ALensThatLetsNothingThroughIsRefused) {
  Flats flats = read_flats({flat_picture(0.6, {}, {-0.3, -0.01, 0})});
  EXPECT_THROW(fit_vignetting(flats.pictures, 110 * degree), Error);
}

}  // namespace previz::calibrate::sensor_test
