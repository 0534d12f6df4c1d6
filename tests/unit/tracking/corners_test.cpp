// Corner refinement against exact, box-filtered pictures: bias, scatter and stated covariance.
#include "daemon/core/tracking/corners.hpp"

#include <opencv2/core.hpp>

#include "daemon/core/tracking/edge.hpp"
#include "daemon/core/tracking/photometry.hpp"
#include "tests/support/test.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::tracking::corners_test {

using test::TagScene;

struct Errors {
  int tags = 0, refused = 0;
  glm::dvec2 mean{0};
  double outward = 0;  // along the diagonal, positive: the tag seems larger
  double rms = 0, most = 0, chi_square = 0;
};

struct Case {
  const char* name;
  double least_side_px = 20, most_side_px = 120;
  double defocus_px = 0, full_well_e = 0;
  ResponseCurve response = {};
  double k1 = 0, k2 = 0, p1 = 0;
  double white = 0.75;
  double shading_per_px = 0;
};

// Tags turned and tilted at random (to 60 degrees), at random sub-pixel places; the start is up to
// 0.8 px off, as libapriltag's corners may be.
Errors measure(const Case& c, int trials) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0, 1);
  const auto between = [&](double a, double b) { return a + (b - a) * unit(random); };
  const Photometry photometry(c.response);
  Errors errors;
  for (int t = 0; t < trials; ++t) {
    TagScene scene;
    scene.lens = test::plain_lens(220, 200, 260);
    scene.lens.k1 = c.k1, scene.lens.k2 = c.k2, scene.lens.p1 = c.p1;
    scene.white = c.white;
    scene.defocus_radius_px = c.defocus_px;
    scene.shading_per_px = {c.shading_per_px, -c.shading_per_px};
    const double tilt = between(0, 1.05), around = between(0, 6.2832);
    const double side = between(c.least_side_px, c.most_side_px);
    const double distance = scene.lens.fx / side;  // tags of 1 m
    const glm::dvec3 view(std::sin(tilt) * std::cos(around), std::sin(tilt) * std::sin(around),
                          std::cos(tilt));
    const double room = std::max(0.0, 0.5 - 0.65 * side / 200) * 200 / side;
    const glm::dvec3 aside(between(-room, room), between(-room, room), 0);
    scene.tags = {test::flat_tag(int(random() % 587), 1, aside, between(0, 6.2832))};
    scene.world_from_camera = test::camera_looking(distance * view, {0, 0, 0}, {0.3, 1, 0.1});
    const CornerPixels exact = test::exact_corners(scene, scene.tags[0]);
    if (narrowest_cell_px(exact, 8) < 1.7) continue;
    bool inside = true;
    for (const glm::dvec2& p : exact)
      inside = inside && p.x > 6 && p.y > 6 && p.x < 213 && p.y < 193;
    if (!inside) continue;

    test::Sensor sensor;
    sensor.full_well_e = c.full_well_e;
    sensor.response = c.response;
    sensor.format = PixelFormat::gray8;
    const Frame frame = test::expose(test::render(scene), sensor, random);
    CornerPixels guess = exact;
    for (glm::dvec2& p : guess) p += glm::dvec2(between(-0.8, 0.8), between(-0.8, 0.8));
    const RefinedCorners refined =
        refine_corners([&](int x, int y) { return photometry.luminance(frame, x, y); }, scene.lens,
                       guess, 8, false);
    ++errors.tags;
    if (!refined.trouble.empty()) {
      ++errors.refused;
      continue;
    }
    const glm::dvec2 middle = (exact[0] + exact[1] + exact[2] + exact[3]) / 4.0;
    cv::Matx<double, 8, 1> e;
    for (std::size_t i = 0; i < 4; ++i) {
      const glm::dvec2 d = refined.pixel[i] - exact[i];
      errors.mean += d;
      errors.outward += glm::dot(d, glm::normalize(exact[i] - middle));
      errors.rms += glm::dot(d, d);
      errors.most = std::max(errors.most, glm::length(d));
      e(int(2 * i)) = d.x, e(int(2 * i) + 1) = d.y;
    }
    errors.chi_square +=
        e.dot(cv::Matx<double, 8, 8>(refined.covariance.data()).solve(e, cv::DECOMP_SVD));
  }
  const double corners = 4.0 * (errors.tags - errors.refused);
  errors.mean /= corners;
  errors.outward /= corners;
  errors.rms = std::sqrt(errors.rms / corners);
  errors.chi_square /= 2 * corners;
  std::printf(
      "  %-34s %3d tags, %d refused: bias %+.4f %+.4f outward %+.4f rms %.4f max %.3f px, "
      "chi2/8 %.2f\n",
      c.name, errors.tags, errors.refused, errors.mean.x, errors.mean.y, errors.outward, errors.rms,
      errors.most, errors.chi_square);
  return errors;
}

// The bound of accuracy: 0.02 px, plus three standard errors of the mean.
void expect_unbiased(const Case& c, int trials = 60, double allowed_px = 0.02) {
  SCOPED_TRACE(c.name);
  const Errors e = measure(c, trials);
  const double corners = 4.0 * (e.tags - e.refused);
  const double bound = allowed_px + 3 * e.rms / std::sqrt(2 * corners);
  EXPECT_GT(e.tags, trials / 4);
  EXPECT_EQ(e.refused, 0);
  EXPECT_LT(std::abs(e.mean.x), bound);
  EXPECT_LT(std::abs(e.mean.y), bound);
  EXPECT_LT(std::abs(e.outward), bound);
}

ResponseCurve curve(ResponseCurve::Kind kind) {
  ResponseCurve c;
  c.kind = kind;
  if (kind == ResponseCurve::Kind::table)
    for (int i = 0; i < 64; ++i) c.inverse_table.push_back(std::pow(i / 63.0, 1.7));
  return c;
}

TEST(TrackingCorners, CleanPicturesOfEveryResponse) {
  using Kind = ResponseCurve::Kind;
  expect_unbiased({.name = "sRGB", .response = curve(Kind::srgb)});
  expect_unbiased({.name = "linear", .response = curve(Kind::linear)});
  expect_unbiased({.name = "gamma 2.2", .response = curve(Kind::gamma)});
  expect_unbiased({.name = "table", .response = curve(Kind::table)});
}

TEST(TrackingCorners, SmallTags) {
  expect_unbiased({.name = "16 to 24 px", .least_side_px = 16, .most_side_px = 24});
}

TEST(TrackingCorners, Noise) {
  expect_unbiased({.name = "30000 e-", .full_well_e = 30000}, 100);
  expect_unbiased({.name = "1000 e-", .full_well_e = 1000}, 100);
}

// Discs up to about a third of a cell's width; beyond, the neighbouring cells run into the edge.
TEST(TrackingCorners, Defocus) {
  expect_unbiased({.name = "disc of 1 px", .least_side_px = 50, .defocus_px = 1});
  expect_unbiased(
      {.name = "disc of 2 px, noise", .least_side_px = 100, .defocus_px = 2, .full_well_e = 30000});
}

// White beyond the sensor's range: how far beyond decides where half of it is, and an edge along
// the pixels says too little about it. Twice the bound, and a covariance that owns up to it.
TEST(TrackingCorners, ClippedWhite) {
  const Case c{.name = "white at 1.6 of the range", .white = 1.6};
  expect_unbiased(c, 60, 0.04);
  EXPECT_LT(measure(c, 60).chi_square, 1.5);
}

TEST(TrackingCorners, Shading) {
  expect_unbiased({.name = "0.3 % a pixel", .shading_per_px = 0.003});
}

TEST(TrackingCorners, LensDistortion) {
  expect_unbiased({.name = "barrel",
                   .least_side_px = 60,
                   .most_side_px = 150,
                   .k1 = -0.25,
                   .k2 = 0.06,
                   .p1 = 0.002});
  expect_unbiased({.name = "pincushion", .least_side_px = 60, .most_side_px = 150, .k1 = 0.2});
}

// chi-square of n corners' errors over their stated covariance has mean 8 a tag and variance 16;
// the model's own bias (box against Gaussian defocus and so on) comes on top, hence a factor
// of 1.5.
TEST(TrackingCorners, StatedCovariance) {
  const Errors e = measure({.name = "covariance, 5000 e-", .full_well_e = 5000}, 200);
  const double scatter = 3 * std::sqrt(2.0 / 8 / (e.tags - e.refused));
  EXPECT_LT(e.chi_square, 1.5 + scatter);
  EXPECT_GT(e.chi_square, 0.7 - scatter);
}

// The closed form against brute-force areas.
TEST(TrackingEdge, CoverageIsTheBoxFilteredHalfPlane) {
  for (double angle : {0.0, 0.2, 0.7853981633974483, 1.2, 1.5707963267948966})
    for (double s : {-0.9, -0.5, -0.2, 0.0, 0.3, 0.8}) {
      const double nx = std::cos(angle), ny = std::sin(angle);
      const int n = 1000;
      int inside = 0;
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j)
          inside += s + nx * ((i + 0.5) / n - 0.5) + ny * ((j + 0.5) / n - 0.5) > 0;
      // A line of cells, at most 1.5 n of them, is counted in halves.
      EXPECT_NEAR(edge_coverage(s, nx, ny, 0), double(inside) / (n * n), 0.75 / n)
          << angle << " " << s;
    }
}

TEST(TrackingEdge, CoverageDerivatives) {
  const double h = 1e-5;
  for (double angle : {0.0, 0.4, 0.785})
    for (double s : {-0.8, -0.1, 0.4})
      for (double blur : {0.3, 1.0}) {
        const double nx = std::cos(angle), ny = std::sin(angle);
        const auto coverage = [&](double ds, double dblur) {
          return edge_coverage(s + ds, nx, ny, blur + dblur);
        };
        double by_s, by_blur;
        edge_coverage(s, nx, ny, blur, &by_s, &by_blur);
        // Cancellation in a second difference over boxes of 1e-4 leaves 1e-8, over 2h 1e-3.
        EXPECT_NEAR(by_s, (coverage(h, 0) - coverage(-h, 0)) / (2 * h), 1e-4);
        EXPECT_NEAR(by_blur, (coverage(0, h) - coverage(0, -h)) / (2 * h), 1e-4);
      }
}

}  // namespace previz::tracking::corners_test
