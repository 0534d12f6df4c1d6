#include "daemon/tools/calibrate/lens/observer.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <opencv2/calib3d.hpp>

#include "daemon/tools/calibrate/lens/opencv_pose.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

// Indices in observer_parameters.
enum Parameter : std::size_t { k1 = 4, k2, p1, p2, k3 };
constexpr std::size_t first_coefficient = k1;
constexpr int grid_columns = 16;

struct CvView {
  std::vector<cv::Point3f> points;
  std::vector<cv::Point2f> pixels;
};

int grid_rows(int width, int height) {
  return std::max(2, grid_columns * height / width);
}

std::vector<CvView> to_cv(const std::vector<View>& views) {
  std::vector<CvView> all(views.size());
  for (std::size_t v = 0; v < views.size(); ++v)
    for (std::size_t i = 0; i < views[v].points.size(); ++i) {
      const glm::dvec3& x = views[v].points[i];
      const glm::dvec2& p = views[v].pixels[i];
      all[v].points.emplace_back(float(x.x), float(x.y), float(x.z));
      all[v].pixels.emplace_back(float(p.x), float(p.y));
    }
  return all;
}

// Estimates the focal length from the vanishing points of each view (Zhang 2000), without
// distortion yet.
Bundle started_lens(const Views& views) {
  const std::vector<CvView> all = to_cv(views.views);
  std::vector<std::vector<cv::Point3f>> points;
  std::vector<std::vector<cv::Point2f>> pixels;
  for (const CvView& view : all) {
    points.push_back(view.points);
    pixels.push_back(view.pixels);
  }
  cv::Mat1d camera = cv::initCameraMatrix2D(points, pixels, {views.width, views.height}, 1);
  const double widest = std::max(views.width, views.height);
  const double f = camera(0, 0);
  // Views without tilt have their vanishing points anywhere: start with a lens of 50 degrees
  // instead.
  if (!(f > 0.2 * widest && f < 20 * widest)) camera(0, 0) = camera(1, 1) = 1.07 * widest;

  Bundle start;
  start.lens = {camera(0, 0), camera(1, 1), camera(0, 2), camera(1, 2), 0, 0, 0, 0, 0};
  for (std::size_t v = 0; v < all.size(); ++v) {
    cv::Mat turn, shift;
    if (!cv::solvePnP(all[v].points, all[v].pixels, camera, cv::noArray(), turn, shift, false,
                      cv::SOLVEPNP_IPPE))
      throw Error(views.views[v].name + ": no board pose fits its corners");
    start.poses.push_back(from_opencv(turn, shift));
  }
  return start;
}

// Returns the Bayesian information criterion for each residual; smaller is better. Outliers differ
// from fit to fit, and so does the number of residuals.
double bayesian_information(const BundleFit& fit) {
  const double n = 2 * double(fit.corners_used);
  return std::log(fit.sigma_px * fit.sigma_px) + double(fit.bundle.lens.size()) * std::log(n) / n;
}

// Returns a lens in the order of observer_parameters whose other coefficients are 0.
std::vector<double> whole_lens(std::span<const double> fitted,
                               const std::vector<std::size_t>& coefficients) {
  std::vector<double> lens(observer_parameters.size(), 0);
  std::copy_n(fitted.begin(), first_coefficient, lens.begin());
  for (std::size_t i = 0; i < coefficients.size(); ++i)
    lens[coefficients[i]] = fitted[first_coefficient + i];
  return lens;
}

ObserverFit fit_model(const Views& views, Bundle start,
                      const std::vector<std::size_t>& coefficients) {
  const Projection project = [&](std::span<const double> fitted, const glm::dvec3& point) {
    return project_pinhole(whole_lens(fitted, coefficients), point);
  };
  start.lens.resize(first_coefficient + coefficients.size());
  ObserverFit observer;
  observer.fit = fit_bundle(views.views, start, project);
  observer.intrinsics =
      pinhole(whole_lens(observer.fit.bundle.lens, coefficients), views.width, views.height);
  observer.sigma = whole_lens(lens_sigma(observer.fit), coefficients);
  for (std::size_t p = 0; p < observer_parameters.size(); ++p)
    if (p < first_coefficient || std::ranges::find(coefficients, p) != coefficients.end())
      observer.parameters.push_back(observer_parameters[p]);
  observer.picture =
      projection_uncertainty(observer.fit, project, picture_rays(observer.intrinsics));
  return observer;
}

bool is_better(const ObserverFit& fit, const ObserverFit& than) {
  if (folds(fit.intrinsics) != folds(than.intrinsics)) return folds(than.intrinsics);
  const bool is_useless = worst_px(fit.picture) > useless_px;
  if (is_useless != (worst_px(than.picture) > useless_px)) return !is_useless;
  return bayesian_information(fit.fit) < bayesian_information(than.fit);
}

double reach_of(const Views& views) {
  const glm::dvec2 middle(0.5 * (views.width - 1), 0.5 * (views.height - 1));
  double farthest = 0;
  for (const View& view : views.views)
    for (const glm::dvec2& pixel : view.pixels)
      farthest = std::max(farthest, glm::distance(pixel, middle));
  return farthest / (0.5 * std::hypot(views.width, views.height));
}

}  // namespace

std::vector<glm::dvec3> picture_rays(const PinholeIntrinsics& lens) {
  std::vector<glm::dvec3> rays;
  const int rows = grid_rows(lens.width, lens.height);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < grid_columns; ++column) {
      const glm::dvec2 pixel((lens.width - 1) * (column + 0.5) / grid_columns,
                             (lens.height - 1) * (row + 0.5) / rows);
      if (const auto x = undistort(lens, pixel)) rays.push_back(glm::normalize(glm::dvec3(*x, 1)));
    }
  return rays;
}

bool folds(const PinholeIntrinsics& lens) {
  return picture_rays(lens).size() <
         std::size_t(grid_columns) * std::size_t(grid_rows(lens.width, lens.height));
}

PinholeIntrinsics pinhole(std::span<const double> lens, int width, int height) {
  return {.width = width,
          .height = height,
          .fx = lens[0],
          .fy = lens[1],
          .cx = lens[2],
          .cy = lens[3],
          .k1 = lens[4],
          .k2 = lens[5],
          .p1 = lens[6],
          .p2 = lens[7],
          .k3 = lens.size() > k3 ? lens[k3] : 0};
}

std::optional<glm::dvec2> project_pinhole(std::span<const double> lens, const glm::dvec3& point) {
  if (!(point.z > 0)) return std::nullopt;
  return distort(pinhole(lens, 0, 0), {point.x / point.z, point.y / point.z});
}

double worst_px(const std::vector<UncertainPixel>& picture) {
  double worst = 0;
  for (const UncertainPixel& pixel : picture) worst = std::max(worst, pixel.sigma_px);
  return worst;
}

ObserverFit fit_observer(const Views& views) {
  const Bundle start = started_lens(views);
  const std::vector<std::vector<std::size_t>> models = {
      {k1}, {k1, k2}, {k1, p1, p2}, {k1, k2, p1, p2}, {k1, k2, p1, p2, k3}};
  std::optional<ObserverFit> best;
  std::vector<double> whole, whole_covariance;
  for (const std::vector<std::size_t>& coefficients : models) {
    ObserverFit fit = fit_model(views, start, coefficients);
    whole = fit.fit.bundle.lens;  // the last model has all
    whole_covariance = fit.fit.lens_covariance;
    if (!best || is_better(fit, *best)) best = std::move(fit);
  }
  for (std::size_t p = first_coefficient; p < observer_parameters.size(); ++p)
    if (best->sigma[p] == 0) best->left_out.push_back(observer_parameters[p]);
  best->whole_lens = std::move(whole);
  best->whole_covariance = std::move(whole_covariance);
  best->reach = reach_of(views);
  return std::move(*best);
}

ObserverFit fit_observer_by_few(const Views& views) {
  const auto lens_of = [&](std::span<const double> few) {
    const double f = few[0];
    return PinholeIntrinsics{.width = views.width,
                             .height = views.height,
                             .fx = f,
                             .fy = f,
                             .cx = 0.5 * (views.width - 1),
                             .cy = 0.5 * (views.height - 1),
                             .k1 = few[1]};
  };
  const Projection project = [&](std::span<const double> few,
                                 const glm::dvec3& point) -> std::optional<glm::dvec2> {
    if (!(point.z > 0)) return std::nullopt;
    return distort(lens_of(few), {point.x / point.z, point.y / point.z});
  };
  Bundle start = started_lens(views);
  start.lens = {start.lens[0], 0};
  ObserverFit observer;
  observer.fit = fit_bundle(views.views, start, project);
  observer.intrinsics = lens_of(observer.fit.bundle.lens);
  const std::vector<double> sigma = lens_sigma(observer.fit);
  observer.sigma = {sigma[0], sigma[0], 0, 0, sigma[1], 0, 0, 0, 0};
  observer.parameters.assign(few_observer_parameters.begin(), few_observer_parameters.end());
  observer.reach = reach_of(views);
  observer.picture =
      projection_uncertainty(observer.fit, project, picture_rays(observer.intrinsics));
  return observer;
}

}  // namespace previz::calibrate
