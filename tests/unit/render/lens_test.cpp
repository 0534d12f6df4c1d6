// The film camera's lens as the shaders have it: a ray for each corner of a pixel.
#include "daemon/core/render/corner_rays.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "tests/support/render_fixture.hpp"

namespace previz::test::lens_test {

// The corners of the picture are 0.82 off the axis.
PinholeIntrinsics lens_of(double k1, double k4) {
  PinholeIntrinsics lens{.width = 80, .height = 60, .fx = 60, .fy = 61, .cx = 39, .cy = 29};
  lens.k1 = k1, lens.k4 = k4;
  return lens;
}

// A ray is a float, which is off by 6e-8 of 0.82 or less; that is much less than the 0.01 px that
// are promised. At the corners of the last lens, r / (1 - r^2), where r is 0.57, OpenCV's iteration
// takes only 1 - 2 r^2 / (1 - r^2) = 1/20 of its error away in each step, too little in 100 steps.
TEST(LensRays, MeetTheirPixelsThroughARationalLens) {
  PinholeIntrinsics all = lens_of(-0.118, 0.09);
  all.k2 = 0.041, all.k3 = -0.006, all.p1 = 9e-4, all.p2 = -7e-4, all.k5 = -0.03, all.k6 = 0.02;
  for (const PinholeIntrinsics& lens : {all, lens_of(0, 0.21), lens_of(8.1, 8.4), lens_of(0, -1)}) {
    const auto rays = render::corner_rays(lens);
    ASSERT_EQ(rays.size(), 81u * 61u);
    double most = 0;
    for (int j = 0; j <= 60; ++j)
      for (int i = 0; i <= 80; ++i) {
        const auto ray = rays[static_cast<std::size_t>(j) * 81 + static_cast<std::size_t>(i)];
        most = std::max(most, glm::distance(distort(lens, glm::dvec2(ray)), {i - 0.5, j - 0.5}));
      }
    EXPECT_LT(most, 0.01) << "k1 " << lens.k1 << ", k4 " << lens.k4;
  }
}

void expect_refused(const PinholeIntrinsics& lens, const std::string& which) {
  EXPECT_THAT(error_of([&] { render::corner_rays(lens); }),
              StartsWith("observer.intrinsics: the distortion cannot be inverted at pixel"))
      << which;
}

// The divisors 1 - 2 r^2 and (with a dividend that cancels it) again reach zero at 0.71.
TEST(LensRays, AreRefusedWhereTheLensFoldsInThePicture) {
  expect_refused(lens_of(-0.6, 0), "a polynomial that turns");
  expect_refused(lens_of(0, 1.2), "a divisor that turns");
  expect_refused(lens_of(0, -2), "a divisor that reaches zero");
  expect_refused(lens_of(-2, -2), "a divisor that reaches zero, cancelled");
  expect_refused(lens_of(-2, -2 - 1e-9), "a divisor that reaches zero, all but cancelled");
  expect_refused(lens_of(-2 - 1e-9, -2), "a dividend that reaches zero just before the divisor");
}

TEST(LensRays, AreRefusedOfHostileNumbers) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  for (const auto term : {&PinholeIntrinsics::k1, &PinholeIntrinsics::k2, &PinholeIntrinsics::p1,
                          &PinholeIntrinsics::p2, &PinholeIntrinsics::k3, &PinholeIntrinsics::k4,
                          &PinholeIntrinsics::k5, &PinholeIntrinsics::k6})
    for (const double value : {std::nan(""), infinity, -infinity, 1e30, -1e30}) {
      PinholeIntrinsics lens = lens_of(0, 0);
      lens.*term = value;
      expect_refused(lens, std::to_string(value));
    }
}

}  // namespace previz::test::lens_test
