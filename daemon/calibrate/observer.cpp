#include "daemon/calibrate/observer.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <opencv2/calib3d.hpp>

#include "daemon/calibrate/opencv_pose.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr std::size_t k3_parameter = 8;
constexpr int grid_columns = 16;

struct CvView {
  std::vector<cv::Point3f> points;
  std::vector<cv::Point2f> pixels;
};

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
      throw Error(views.views[v].name + ": no pose of the board explains its corners");
    start.poses.push_back(from_opencv(turn, shift));
  }
  return start;
}

// Returns the Bayesian information criterion; smaller is better. A further parameter must lower it
// to be kept.
double bayesian_information(const BundleFit& fit, std::size_t parameters) {
  const double n = 2 * double(fit.corners_used);
  return n * std::log(fit.sigma_px * fit.sigma_px) + double(parameters) * std::log(n);
}

std::vector<glm::dvec3> picture_rays(const PinholeIntrinsics& lens) {
  std::vector<glm::dvec3> rays;
  const int rows = std::max(2, grid_columns * lens.height / lens.width);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < grid_columns; ++column) {
      const glm::dvec2 pixel((lens.width - 1) * (column + 0.5) / grid_columns,
                             (lens.height - 1) * (row + 0.5) / rows);
      if (const auto x = undistort(lens, pixel)) rays.push_back(glm::normalize(glm::dvec3(*x, 1)));
    }
  return rays;
}

}  // namespace

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
          .k3 = lens.size() > k3_parameter ? lens[k3_parameter] : 0};
}

std::optional<glm::dvec2> project_pinhole(std::span<const double> lens, const glm::dvec3& point) {
  if (!(point.z > 0)) return std::nullopt;
  return distort(pinhole(lens, 0, 0), {point.x / point.z, point.y / point.z});
}

ObserverFit fit_observer(const Views& views) {
  Bundle start = started_lens(views);
  start.lens.resize(k3_parameter);
  ObserverFit observer;
  observer.fit = fit_bundle(views.views, start, project_pinhole);
  Bundle with_k3 = observer.fit.bundle;
  with_k3.lens.push_back(0);
  BundleFit fuller = fit_bundle(views.views, with_k3, project_pinhole);
  if (bayesian_information(fuller, k3_parameter + 1) <
      bayesian_information(observer.fit, k3_parameter))
    observer.fit = std::move(fuller);

  const BundleFit& fit = observer.fit;
  observer.intrinsics = pinhole(fit.bundle.lens, views.width, views.height);
  observer.sigma.assign(observer_parameters.size(), 0);
  std::ranges::copy(lens_sigma(fit), observer.sigma.begin());
  observer.picture =
      projection_uncertainty(fit, project_pinhole, picture_rays(observer.intrinsics));
  return observer;
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
  observer.picture =
      projection_uncertainty(observer.fit, project, picture_rays(observer.intrinsics));
  return observer;
}

}  // namespace previz::calibrate
