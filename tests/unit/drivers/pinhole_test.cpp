// The film camera's lens in numbers, against OpenCV's and against what is known in closed form.
#include "drivers/calibration/pinhole.hpp"

#include <opencv2/calib3d.hpp>

#include "tests/support/test.hpp"

namespace previz::pinhole_test {

// Focal lengths are about 600 px, and the picture's corners are 0.8 off the axis or less.
PinholeIntrinsics plain_lens() {
  return {.width = 800, .height = 600, .fx = 600, .fy = 603, .cx = 401, .cy = 298};
}

struct NamedLens {
  const char* name;
  PinholeIntrinsics lens;
};

void PrintTo(const NamedLens& named, std::ostream* out) {
  *out << named.name;
}

std::vector<NamedLens> lenses() {
  PinholeIntrinsics polynomial = plain_lens();
  polynomial.k1 = -0.118, polynomial.k2 = 0.041, polynomial.k3 = -0.006;
  polynomial.p1 = 9e-4, polynomial.p2 = -7e-4;
  PinholeIntrinsics rational = polynomial;
  rational.k4 = 0.09, rational.k5 = -0.03, rational.k6 = 0.02;
  PinholeIntrinsics division = plain_lens();  // Fitzgibbon 2001
  division.k4 = 0.21;
  // Dividend and divisor nearly cancel, as in fits to wide lenses.
  PinholeIntrinsics cancelling = rational;
  cancelling.k1 = 8.1, cancelling.k2 = 3.2, cancelling.k3 = 0.13;
  cancelling.k4 = 8.4, cancelling.k5 = 5.3, cancelling.k6 = 0.9;
  return {{"polynomial", polynomial},
          {"rational", rational},
          {"division", division},
          {"cancelling", cancelling}};
}

class PinholeLens : public testing::TestWithParam<NamedLens> {
 protected:
  const PinholeIntrinsics& lens_ = GetParam().lens;
};

INSTANTIATE_TEST_SUITE_P(Of, PinholeLens, testing::ValuesIn(lenses()),
                         [](const auto& named) { return std::string(named.param.name); });

// Both sides round some ten times, each to 1e-16 of some 600 px.
TEST_P(PinholeLens, ProjectsAsOpenCvDoes) {
  const PinholeIntrinsics& k = lens_;
  const cv::Matx33d camera(k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1);
  const std::vector<double> distortion{k.k1, k.k2, k.p1, k.p2, k.k3, k.k4, k.k5, k.k6};
  for (double x = -0.7; x < 0.71; x += 0.1)
    for (double y = -0.5; y < 0.51; y += 0.1) {
      std::vector<cv::Point2d> pixel;
      cv::projectPoints(std::vector<cv::Point3d>{{x, y, 1}}, cv::Vec3d(), cv::Vec3d(), camera,
                        distortion, pixel);
      const glm::dvec2 ours = distort(k, {x, y});
      EXPECT_NEAR(ours.x, pixel[0].x, 1e-11) << x << ", " << y;
      EXPECT_NEAR(ours.y, pixel[0].y, 1e-11) << x << ", " << y;
    }
}

// A central difference over 2 h is off by h^2 / 6 of the third derivative, which is below 1e5 px
// here, so by 2e-8, and by rounding to 1e-13 px over h, so by 1e-7.
TEST_P(PinholeLens, HasTheJacobianOfItsDifferences) {
  constexpr double h = 1e-6;
  for (double x = -0.7; x < 0.71; x += 0.1)
    for (double y = -0.5; y < 0.51; y += 0.1) {
      glm::dmat2 jacobian;
      distort(lens_, {x, y}, &jacobian);
      for (int axis = 0; axis < 2; ++axis) {
        glm::dvec2 step(0);
        step[axis] = h;
        const glm::dvec2 up = distort(lens_, glm::dvec2(x, y) + step);
        const glm::dvec2 down = distort(lens_, glm::dvec2(x, y) - step);
        EXPECT_LT(glm::distance((up - down) / (2 * h), jacobian[axis]), 5e-7) << x << ", " << y;
      }
    }
}

// The promise is 1e-9 px; rounding adds 1e-12.
TEST_P(PinholeLens, IsInvertedAllOverThePicture) {
  for (double u = -0.5; u < lens_.width; u += 20)
    for (double v = -0.5; v < lens_.height; v += 20) {
      const auto ray = undistort(lens_, {u, v});
      ASSERT_TRUE(ray) << u << ", " << v;
      EXPECT_LT(glm::distance(distort(lens_, *ray), {u, v}), 1.001e-9);
      glm::dmat2 jacobian;
      const auto back = undistort(lens_, distort(lens_, *ray, &jacobian));
      ASSERT_TRUE(back) << u << ", " << v;
      EXPECT_LT(glm::length(jacobian * (*back - *ray)), 1.001e-9);
    }
}

// Along one axis, in focal lengths from the centre.
std::optional<double> radius_shown(const PinholeIntrinsics& lens, double at) {
  const auto ray = undistort(lens, {lens.cx + at * lens.fx, lens.cy});
  return ray ? std::optional(ray->x) : std::nullopt;
}

// r - 0.4 r^3 + 0.05 r^5 turns at r = 1.036, where it is 0.651, and grows again from r = 1.93 on:
// it is 0.9 at r = 2.42, but nothing is seen there.
TEST(PinholeFold, IsNotCrossedToWhereTheLensGrowsAgain) {
  PinholeIntrinsics lens = plain_lens();
  lens.k1 = -0.4, lens.k2 = 0.05;
  EXPECT_TRUE(radius_shown(lens, 0.65));
  for (double at = 0.66; at < 2; at += 0.02) EXPECT_FALSE(radius_shown(lens, at)) << at;
}

// y = r / (1 + r^2) turns at r = 1, where it is 0.5; before it, r = (1 - sqrt(1 - 4 y^2)) / (2 y).
// An error of 1e-9 px is 2e-12 of the focal length, and the slope at 0.49 is 0.12.
TEST(PinholeFold, OfADivisorHasNoInverseBeyondIt) {
  PinholeIntrinsics lens = plain_lens();
  lens.k4 = 1;
  const auto shown = radius_shown(lens, 0.49);
  ASSERT_TRUE(shown);
  EXPECT_NEAR(*shown, (1 - std::sqrt(1 - 4 * 0.49 * 0.49)) / (2 * 0.49), 2e-12 / 0.12);
  for (double at = 0.501; at < 3; at += 0.05) EXPECT_FALSE(radius_shown(lens, at)) << at;
}

// The divisor 1 - r^2 is 0 at r = 1. With the same dividend the quotient is 1 on both sides of it,
// and with one that differs by a millionth nearly so.
TEST(PinholeFold, HasNoInverseWhereTheDivisorReachesZero) {
  PinholeIntrinsics lens = plain_lens();
  lens.k1 = lens.k4 = -1;
  for (const double other : {-1.0, -1 - 1e-6, -1 + 1e-6}) {
    lens.k4 = other;
    const auto shown = radius_shown(lens, 0.9);
    ASSERT_TRUE(shown);
    EXPECT_NEAR(*shown, 0.9, 1e-4);  // 1e-6 over the divisor, 0.19, and some slope
    for (double at = 1.01; at < 3; at += 0.05)
      EXPECT_FALSE(radius_shown(lens, at)) << other << " at " << at;
  }
  lens.k1 = 0, lens.k4 = -1;
  EXPECT_FALSE(std::isfinite(distort(lens, {1, 0}).x));
  EXPECT_FALSE(is_unfolded(lens, {1, 0}, {lens.cx, lens.cy}));
  EXPECT_FALSE(is_unfolded(lens, {0.5, 0}, {lens.cx + 1.01 * lens.fx, lens.cy}));
  EXPECT_TRUE(is_unfolded(lens, {0.5, 0}, {lens.cx + 0.99 * lens.fx, lens.cy}));
}

// The double zero of (1 - r^2)^2 is found as well: the divisor touches zero and is not below it.
TEST(PinholeFold, IsFoundWhereTheDivisorOnlyTouchesZero) {
  PinholeIntrinsics lens = plain_lens();
  lens.k4 = -2, lens.k5 = 1;
  const glm::dvec2 centre(lens.cx, lens.cy);
  EXPECT_TRUE(is_unfolded(lens, {0.999, 0}, centre));
  EXPECT_FALSE(is_unfolded(lens, {1, 0}, centre));
  EXPECT_FALSE(is_unfolded(lens, {1.3, 0}, centre));
}

// Whatever comes back is right to what is promised; what is not a number comes back never.
TEST(PinholeFold, IsNotPassedByHostileNumbers) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (const auto term : {&PinholeIntrinsics::k1, &PinholeIntrinsics::k2, &PinholeIntrinsics::p1,
                          &PinholeIntrinsics::p2, &PinholeIntrinsics::k3, &PinholeIntrinsics::k4,
                          &PinholeIntrinsics::k5, &PinholeIntrinsics::k6})
    for (const double value : {std::nan(""), infinity, -infinity, 1e30, -1e30, 1e308, -1e308}) {
      PinholeIntrinsics lens = plain_lens();
      lens.*term = value;
      const glm::dvec2 pixel(-0.5, 599.5);
      const auto ray = undistort(lens, pixel);
      if (ray) {
        EXPECT_TRUE(std::isfinite(value)) << value;
        EXPECT_LT(glm::distance(distort(lens, *ray), pixel), 1e-9) << value;
      }
    }
  for (const double value : {std::nan(""), infinity})
    EXPECT_FALSE(undistort(plain_lens(), {value, 0}));
}

}  // namespace previz::pinhole_test
