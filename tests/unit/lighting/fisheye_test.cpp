#include "drivers/calibration/fisheye.hpp"

#include "tests/support/lighting_pictures.hpp"
#include "tests/support/test.hpp"

namespace previz::lighting::fisheye_test {

using std::numbers::pi;
using test::degree;

FisheyeIntrinsics wide(std::array<double, 4> k, double max_angle_deg = 130) {
  return {512, 480, 150.5, 149.25, 250.125, 241.75, k, max_angle_deg * degree};
}

glm::dvec3 direction(double off_axis, double psi) {
  return {std::sin(off_axis) * std::cos(psi), std::sin(off_axis) * std::sin(psi),
          std::cos(off_axis)};
}

TEST(Fisheye, WithoutDistortionIsEquidistant) {
  const Fisheye lens(wide({}));
  for (double angle : {0.0, 1e-9, 0.1, 1.0, 0.5 * pi, 100 * degree, 130 * degree - 1e-12})
    for (double psi : {0.0, 0.7, 2.0, -3.0}) {
      const auto pixel = lens.project(7.5 * direction(angle, psi));
      ASSERT_TRUE(pixel);
      EXPECT_NEAR(pixel->x, 250.125 + 150.5 * angle * std::cos(psi), 1e-10);
      EXPECT_NEAR(pixel->y, 241.75 + 149.25 * angle * std::sin(psi), 1e-10);
    }
}

TEST(Fisheye, ProjectsThePolynomialBeyondNinetyDegrees) {
  const std::array k{-0.02, 0.002, -0.0003, 0.00001};
  const Fisheye lens(wide(k));
  const double t = 115 * degree;
  const double r = t + k[0] * std::pow(t, 3) + k[1] * std::pow(t, 5) + k[2] * std::pow(t, 7) +
                   k[3] * std::pow(t, 9);
  const auto pixel = lens.project(direction(t, 0.3));
  ASSERT_TRUE(pixel);
  EXPECT_NEAR(pixel->x, 250.125 + 150.5 * r * std::cos(0.3), 1e-10);
  EXPECT_NEAR(pixel->y, 241.75 + 149.25 * r * std::sin(0.3), 1e-10);
}

TEST(Fisheye, RoundTripsUpToTheCalibratedAngle) {
  for (const std::array<double, 4>& k : {std::array<double, 4>{},
                                         {-0.02, 0.002, -0.0003, 0.0},
                                         {0.05, -0.01, 0.001, 0.0},
                                         {-0.0085, -0.0009, 0.0003, -0.00003}}) {
    const Fisheye lens(wide(k));
    for (int i = 0; i <= 2000; ++i) {
      const double angle = lens.max_angle_rad() * (1 - 1e-13) * i / 2000;
      const glm::dvec3 expected = direction(angle, 0.37 * i);
      const auto pixel = lens.project(expected);
      ASSERT_TRUE(pixel);
      const auto back = lens.unproject(*pixel);
      ASSERT_TRUE(back) << "angle " << angle / degree;
      EXPECT_LT(glm::length(*back - expected), 1e-9) << "angle " << angle / degree;
    }
  }
}

TEST(Fisheye, RoundTripsOnEveryPixel) {
  const Fisheye lens(wide({-0.02, 0.002, -0.0003, 0}, 100));
  int seen = 0;
  for (int y = 0; y < 480; ++y)
    for (int x = 0; x < 512; ++x) {
      const auto ray = lens.unproject({x, y});
      if (!ray) continue;
      ++seen;
      ASSERT_NEAR(glm::length(*ray), 1, 1e-14);
      const auto pixel = lens.project(*ray);
      ASSERT_TRUE(pixel);
      ASSERT_NEAR(pixel->x, x, 1e-9);
      ASSERT_NEAR(pixel->y, y, 1e-9);
    }
  EXPECT_GT(seen, 100000);
}

TEST(Fisheye, IsInvalidBeyondTheCalibratedAngle) {
  const Fisheye lens(wide({}, 100));
  EXPECT_TRUE(lens.project(direction(100 * degree - 1e-9, 1)));
  EXPECT_FALSE(lens.project(direction(100 * degree + 1e-9, 1)));
  EXPECT_FALSE(lens.project({0, 0, -1}));
  EXPECT_FALSE(lens.project({0, 0, 0}));
  EXPECT_FALSE(lens.project({std::nan(""), 0, 1}));
  EXPECT_TRUE(lens.unproject({250.125 + 150.5 * (100 * degree - 1e-9), 241.75}));
  EXPECT_FALSE(lens.unproject({250.125 + 150.5 * (100 * degree + 1e-9), 241.75}));
}

TEST(Fisheye, StopsWherePolynomialTurnsBack) {
  // dr/dt = 1 - 0.6 t^2 is 0 at sqrt(1 / 0.6).
  const std::array k{-0.2, 0.0, 0.0, 0.0};
  EXPECT_NEAR(monotonic_limit_rad(k), std::sqrt(1 / 0.6), 1e-12);
  const Fisheye lens(wide(k));
  EXPECT_NEAR(lens.max_angle_rad(), std::sqrt(1 / 0.6), 1e-12);
  EXPECT_FALSE(lens.project(direction(std::sqrt(1 / 0.6) + 1e-6, 0)));
  const auto edge = lens.project(direction(lens.max_angle_rad() - 1e-9, 0));
  ASSERT_TRUE(edge);
  EXPECT_TRUE(lens.unproject(*edge));
  // (1 - t^2 / 1.21)(1 - t^2 / 1.44), dr/dt of this k: two turning points close together.
  const double a = 1 / 1.21, b = 1 / 1.44;
  EXPECT_NEAR(monotonic_limit_rad({-(a + b) / 3, a * b / 5, 0, 0}), 1.1, 1e-9);
  // r = t - t^5 / 20: slope 1 - t^4 / 4, zero at sqrt(2).
  EXPECT_NEAR(monotonic_limit_rad({0, -0.05, 0, 0}), std::numbers::sqrt2, 1e-12);
  EXPECT_EQ(monotonic_limit_rad({0, 0, 0, 0}), pi);
}

}  // namespace previz::lighting::fisheye_test
