// The observer's calibration on boards seen by a lens that is known, and what it asks for where
// views are missing.
#include <opencv2/core.hpp>

#include "daemon/core/set/load.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/calibrate/lens/coverage.hpp"
#include "daemon/tools/calibrate/lens/observer.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"
#include "daemon/tools/calibrate/lens/residual_plot.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "tests/support/calibrate_pictures.hpp"

namespace previz::calibrate::observer_test {

using test::Held;

constexpr int width = 1280, height = 720;
constexpr double noise_px = 0.15;

PinholeIntrinsics film_lens() {
  return {width, height, 1010, 1013, 652, 349, -0.21, 0.08, 0.0007, -0.0004};
}

std::optional<glm::dvec2> through(const PinholeIntrinsics& lens, const glm::dvec3& point) {
  const double all[] = {lens.fx, lens.fy, lens.cx, lens.cy, lens.k1,
                        lens.k2, lens.p1, lens.p2, lens.k3};
  return project_pinhole(all, point);
}

Views captured(const std::vector<Held>& how, unsigned seed = 1) {
  return test::hold(how, film_lens(), noise_px, seed);
}

std::string first_missing(const std::vector<Held>& how) {
  const Views views = captured(how);
  const auto missing = missing_views(views, fit_observer(views));
  return missing.empty() ? "" : missing.front();
}

std::vector<double> values(const PinholeIntrinsics& lens) {
  return {lens.fx, lens.fy, lens.cx, lens.cy, lens.k1, lens.k2, lens.p1, lens.p2};
}

// Twenty captures: each parameter's error over its stated deviation is a unit normal. 160 values
// (8 correlated ones a capture, so 20 independent at worst) beyond 4 deviations: 20 captures x 8 x
// 6e-5 = 1 %; their mean square is 1 within 4 sqrt(2/20) = 1.26 where the 8 were one.
TEST(ObserverCalibration, ErrorsAreAsLargeAsStated) {
  double squares = 0;
  int count = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const ObserverFit observer = fit_observer(captured(test::careful_capture(), seed));
    const auto truth = values(film_lens()), found = values(observer.intrinsics);
    for (std::size_t p = 0; p < truth.size(); ++p) {
      const double z = (found[p] - truth[p]) / observer.sigma[p];
      // Where k3 was taken in although it is 0, its partners carry its uncertainty with them.
      EXPECT_LT(std::abs(z), 5) << observer_parameters[p] << " seed " << seed;
      squares += z * z;
      ++count;
    }
  }
  EXPECT_NEAR(squares / count, 1, 4 * std::sqrt(2.0 / 20));
}

TEST(ObserverCalibration, RmsIsTheNoise) {
  const Views views = captured(test::careful_capture());
  const ObserverFit observer = fit_observer(views);
  // Two coordinates a corner; a deviation of n samples is known to 1/sqrt(2 n).
  const double n = 2.0 * double(observer.fit.corners_used);
  EXPECT_NEAR(observer.fit.sigma_px, noise_px, 4 * noise_px / std::sqrt(2 * n));
  EXPECT_EQ(observer.fit.corners, observer.fit.corners_used);
  EXPECT_TRUE(missing_views(views, observer).empty());
}

// How far apart two lenses put far points, after the small turn of the camera that brings them
// closest (Gauss-Newton; two steps are ample for hundredths of a degree).
std::vector<glm::dvec2> apart(const PinholeIntrinsics& found, const PinholeIntrinsics& truth,
                              const std::vector<glm::dvec3>& rays) {
  glm::dvec3 turn(0);
  std::vector<glm::dvec2> difference(rays.size());
  for (int step = 0; step < 3; ++step) {
    cv::Matx33d information = cv::Matx33d::zeros();
    cv::Vec3d gradient(0, 0, 0);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const glm::dvec3 turned = rays[i] + glm::cross(turn, rays[i]);
      const glm::dvec2 at = *through(found, turned);
      difference[i] = *through(truth, rays[i]) - at;
      for (int axis = 0; axis < 3; ++axis)
        for (int other = 0; other < 3; ++other) {
          const auto by = [&](int k) {
            glm::dvec3 small(0);
            small[k] = 1e-6;
            return (*through(found, turned + glm::cross(small, rays[i])) - at) / 1e-6;
          };
          information(axis, other) += glm::dot(by(axis), by(other));
          if (other == 0) gradient[axis] += glm::dot(by(axis), difference[i]);
        }
    }
    const cv::Vec3d by = information.inv() * gradient;
    turn += glm::dvec3(by[0], by[1], by[2]);
  }
  return difference;
}

// With s the deviation along a pixel's longest axis, the mean square distance is between s^2 and
// 2 s^2. Thirty captures, in each some 4 numbers that are independent: the mean of their squares
// over what is expected is off by sqrt(2 / 120), four times which is 0.5.
TEST(ObserverCalibration, ProjectionIsAsCertainAsStated) {
  double squares = 0;
  int count = 0;
  for (unsigned seed = 1; seed <= 30; ++seed) {
    const ObserverFit observer = fit_observer(captured(test::careful_capture(), seed));
    std::vector<glm::dvec3> rays;
    for (const UncertainPixel& at : observer.picture) {
      const auto x = undistort(film_lens(), at.pixel);
      ASSERT_TRUE(x);
      rays.emplace_back(*x, 1);
    }
    const auto distances = apart(observer.intrinsics, film_lens(), rays);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      squares += glm::dot(distances[i], distances[i]) / std::pow(observer.picture[i].sigma_px, 2);
      ++count;
    }
  }
  EXPECT_GT(squares / count, 1 - 0.5);
  EXPECT_LT(squares / count, 2 * 1.5);
}

TEST(ObserverCalibration, MistakenCornersAreLeftOut) {
  Views views = captured(test::careful_capture());
  views.views[2].pixels[10] += glm::dvec2(6, -4);
  views.views[5].pixels[30] += glm::dvec2(-3, 9);
  const ObserverFit observer = fit_observer(views);
  EXPECT_FALSE(observer.fit.used[2][10]);
  EXPECT_FALSE(observer.fit.used[5][30]);
  EXPECT_EQ(observer.fit.corners - observer.fit.corners_used, 2u);
  EXPECT_NEAR(observer.intrinsics.fx, film_lens().fx, 5 * observer.sigma[0]);
}

// Something else taken for a board.
TEST(ObserverCalibration, AViewThatDoesNotFitIsLeftOutWhole) {
  Views views = captured(test::careful_capture());
  auto& pixels = views.views[4].pixels;
  for (std::size_t i = 0; i < pixels.size(); ++i)
    pixels[i] = glm::dvec2(640, 360) +
                40.0 * glm::dvec2(std::sin(7.0 * double(i)), std::cos(3.0 * double(i)));
  const ObserverFit observer = fit_observer(views);
  EXPECT_EQ(observer.fit.views_left_out, std::vector<std::size_t>{4});
  EXPECT_NEAR(observer.intrinsics.fx, film_lens().fx, 5 * observer.sigma[0]);
}

TEST(ObserverCapture, AsksForMoreViews) {
  auto how = test::careful_capture();
  how.resize(4);
  EXPECT_THAT(first_missing(how), HasSubstr("more views: 4"));
}

TEST(ObserverCapture, AsksForTheFieldsThatAreEmpty) {
  auto how = test::careful_capture();
  std::erase_if(how, [](const Held& held) { return held.turn_deg > 0; });
  for (Held& held : how) held.middle.x -= 0.05;
  EXPECT_EQ(first_missing(how), "the board in these areas of the picture: top right, right");
}

TEST(ObserverCapture, AsksForTilt) {
  auto how = test::careful_capture();
  for (Held& held : how) held.tip_deg /= 10;
  EXPECT_THAT(first_missing(how), HasSubstr("tipped forwards and backwards"));
  how = test::careful_capture();
  for (Held& held : how) held.turn_deg /= 10;
  EXPECT_THAT(first_missing(how), HasSubstr("turned left and right"));
}

// Why: the same capture without tilt knows the focal length at least ten times worse.
TEST(ObserverCapture, WithoutTiltTheFocalLengthIsNotKnown) {
  auto flat = test::careful_capture();
  for (Held& held : flat) held.turn_deg /= 20, held.tip_deg /= 20;
  const double tilted_sigma = fit_observer(captured(test::careful_capture())).sigma[0];
  EXPECT_GT(fit_observer(captured(flat)).sigma[0], 10 * tilted_sigma);
}

TEST(ObserverCapture, AsksForTheBoardFromNearer) {
  std::vector<Held> how;
  for (const Held& held : test::careful_capture())
    how.push_back({held.turn_deg, held.tip_deg, held.roll_deg,
                   glm::dvec3(0.53 * held.middle.x / 0.12, 0.27 * held.middle.y / 0.09, 1.2)});
  EXPECT_THAT(first_missing(how), HasSubstr("the board from closer"));
}

TEST(ObserverCalibration, PlotsEveryCorner) {
  Views views = captured(test::careful_capture());
  views.views[0].name = "a<b>&c.png";
  views.views[2].pixels[10] += glm::dvec2(6, -4);
  const ObserverFit observer = fit_observer(views);
  const std::string svg = residual_plot_svg(views, observer.fit, observer.picture, "take");
  const auto count = [&](const std::string& what) {
    std::size_t n = 0;
    for (auto at = svg.find(what); at != std::string::npos; at = svg.find(what, at + 1)) ++n;
    return n;
  };
  EXPECT_EQ(count("<line "), observer.fit.corners_used);
  EXPECT_EQ(count("<rect class=\"bar\""), views.views.size());
  EXPECT_EQ(count("a&lt;b&gt;&amp;c.png"), 1u);
  EXPECT_EQ(count("a<b>"), 0u);
}

// The board was held near the picture's middle, and the corners carry waves of half a pixel, as of
// paper that is not flat: a ninth coefficient explains them, and beyond the corners it folds the
// picture or leaves it uncertain by many pixels.
TEST(ObserverCalibration, CoefficientsThatTheCornersDoNotHoldStayAtZero) {
  Views views = captured(test::careful_capture());
  const glm::dvec2 middle(0.5 * width, 0.5 * height);
  for (View& view : views.views) {
    View near = {view.name, {}, {}};
    for (std::size_t i = 0; i < view.pixels.size(); ++i) {
      const glm::dvec2 out = view.pixels[i] - middle;
      const double r = glm::length(out);
      if (r > 0.5 * glm::length(middle)) continue;
      near.points.push_back(view.points[i]);
      near.pixels.push_back(view.pixels[i] + 0.5 * std::sin(r / 45) * out / std::max(r, 1.0));
    }
    view = near;
  }
  std::erase_if(views.views, [](const View& view) { return view.points.size() < 12; });
  const ObserverFit observer = fit_observer(views);
  EXPECT_LT(observer.reach, 0.51);
  EXPECT_FALSE(observer.left_out.empty());
  EXPECT_LE(worst_px(observer.picture), useless_px);
  EXPECT_EQ(observer.picture.size(), 16u * 9u);  // the whole grid: nothing folds
  for (std::size_t p = 4; p < observer_parameters.size(); ++p) {
    const bool is_left_out = std::ranges::count(observer.left_out, observer_parameters[p]) > 0;
    EXPECT_EQ(observer.sigma[p] == 0, is_left_out) << observer_parameters[p];
  }
  EXPECT_EQ(observer.parameters.size() + observer.left_out.size(), observer_parameters.size());
  EXPECT_EQ(observer.fit.bundle.lens.size(), observer.parameters.size());
}

TEST(ObserverCalibration, SaysWhereItIsNotCertain) {
  const Views views = captured(test::careful_capture());
  ObserverFit observer = fit_observer(views);
  EXPECT_TRUE(doubts_of(observer).empty());
  observer.picture[0].sigma_px = 1.4;
  EXPECT_THAT(doubts_of(observer), ElementsAre(HasSubstr("certain only to 1.4 px near 40, 40")));
  EXPECT_TRUE(missing_views(views, observer).empty());
  std::ostringstream out;
  EXPECT_THAT(warn(doubts_of(observer), out),
              StartsWith("# WITH A DOUBT: the lens is certain only to 1.4"));
  EXPECT_THAT(out.str(), StartsWith("warning: the lens is certain only to 1.4 px"));
  observer.picture[0].sigma_px = 0.5;
  observer.reach = 0.55;
  EXPECT_THAT(doubts_of(observer), ElementsAre(HasSubstr("beyond 55 % of the way")));
  observer.picture[0].sigma_px = 6.8;
  EXPECT_THAT(missing_views(views, observer),
              ElementsAre(HasSubstr("the lens is certain only to 6.8 px")));
}

// One frontal view, as a phone on a table: however small its stated deviation, no lens follows.
TEST(ObserverByForce, OneViewGivesNoLens) {
  const Views views = captured({Held{}});
  EXPECT_TRUE(has_few_views(views, fit_observer(views)));
  const std::string why = why_useless(fit_observer_by_few(views));
  EXPECT_THAT(why, HasSubstr("from 1 view), even with --force: film the board turned"));
}

// Three tilted views: the nine parameters of the whole lens run away, and two do not. What the two
// cannot express (a principal point 12 px off, k2) moves the focal length by a few per cent.
TEST(ObserverByForce, ThreeViewsGiveAFocalLength) {
  const Views views =
      captured({{30, 0, 0, {0, 0, 0.3}}, {0, 35, 0, {0, 0, 0.3}}, {-30, -20, 0, {0.02, 0, 0.3}}});
  EXPECT_TRUE(has_few_views(views, fit_observer(views)));
  const ObserverFit few = fit_observer_by_few(views);
  EXPECT_EQ(why_useless(few), "");
  EXPECT_NEAR(few.intrinsics.fx / film_lens().fx, 1, 0.05);
  EXPECT_EQ(few.intrinsics.fx, few.intrinsics.fy);
  EXPECT_EQ(few.intrinsics.k3, 0);
}

TEST(ObserverByForce, ACarefulCaptureKeepsTheWholeLens) {
  const Views views = captured(test::careful_capture());
  EXPECT_FALSE(has_few_views(views, fit_observer(views)));
}

// The table is pasted into a set file and read there in a year: it says itself what it lacks.
TEST(ObserverByForce, TheTableSaysWhatItLacks) {
  std::ostringstream out;
  EXPECT_EQ(insist({}, true, out), "");
  const std::vector<std::string> missing{
      "more views: 1 different ones are usable, 5 are needed, 20 recommended"};
  EXPECT_THROW(insist(missing, false, out), Error);
  const std::string comment = insist(missing, true, out);
  EXPECT_EQ(comment,
            "# UNRELIABLE: accepted with --force although these views are missing:\n"
            "# more views: 1 different ones are usable, 5 are needed, 20 recommended\n");
  const std::string word(120, 'a');
  EXPECT_EQ(as_comment(word + " b"), "# " + word + "\n#   b\n");
  EXPECT_NO_THROW(set::parse_set(comment + set::balance_toml({1, 1, 1}), "printed.toml"));
}

}  // namespace previz::calibrate::observer_test
