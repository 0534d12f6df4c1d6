#include "daemon/tools/calibrate/lens/fisheye.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <numbers>
#include <opencv2/calib3d.hpp>

#include "daemon/tools/calibrate/lens/opencv_pose.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

using std::numbers::pi;

constexpr double trusted_sigma_px = 1;
constexpr std::size_t trusted_sectors = 3;

std::optional<glm::dvec2> project_fisheye(std::span<const double> lens, const glm::dvec3& point) {
  return fisheye_pixel(fisheye(lens, 0, 0), point);
}

// Returns the median distance of a view's corners from where lens and pose put them.
double median_error_px(const View& view, const FisheyeIntrinsics& lens,
                       const tracking::CameraFromWorld& pose) {
  std::vector<double> errors;
  for (std::size_t i = 0; i < view.points.size(); ++i)
    errors.push_back(glm::distance(
        view.pixels[i], fisheye_pixel(lens, pose.rotation * view.points[i] + pose.translation)));
  std::ranges::nth_element(errors, errors.begin() + std::ptrdiff_t(errors.size() / 2));
  return errors[errors.size() / 2];
}

struct Start {
  Bundle bundle;
  double error_px = HUGE_VAL;  // sum over views of the median
};

Start equidistant(const Views& views, double focal_px) {
  const FisheyeIntrinsics lens{.width = views.width,
                               .height = views.height,
                               .fx = focal_px,
                               .fy = focal_px,
                               .cx = 0.5 * (views.width - 1),
                               .cy = 0.5 * (views.height - 1),
                               .k = {},
                               .max_angle_rad = pi};
  Start start{{{focal_px, focal_px, lens.cx, lens.cy, 0, 0, 0, 0}, {}}, 0};
  const Fisheye rays(lens);
  for (const View& view : views.views) {
    const auto pose = pose_by_rays(view, rays);
    if (!pose) return {};
    start.bundle.poses.push_back(*pose);
    start.error_px += median_error_px(view, lens, *pose);
  }
  return start;
}

// The starts range from a picture that shows 30 degrees to one whose image circle fills a third of
// it.
Bundle started(const Views& views) {
  Start best;
  const double side = std::min(views.width, views.height);
  for (double focal_px = 2 * side; focal_px > 0.1 * side; focal_px /= 1.1) {
    Start start = equidistant(views, focal_px);
    if (start.error_px < best.error_px) best = std::move(start);
  }
  if (best.bundle.poses.empty())
    throw Error("no fisheye lens fits the corners: does the board match --board?");
  return best.bundle;
}

double angle_off_axis(const glm::dvec3& point) {
  return std::atan2(std::hypot(point.x, point.y), point.z);
}

void measure_reach(const Views& views, FisheyeFit& fisheye_fit) {
  const BundleFit& fit = fisheye_fit.fit;
  for (std::size_t v = 0; v < views.views.size(); ++v)
    for (std::size_t i = 0; i < views.views[v].points.size(); ++i) {
      if (!fit.used[v][i]) continue;
      const auto& pose = fit.bundle.poses[v];
      const glm::dvec3 point = pose.rotation * views.views[v].points[i] + pose.translation;
      const double around = std::atan2(point.y, point.x) + pi;
      const auto sector = std::min<std::size_t>(7, std::size_t(around / (pi / 4)));
      double& reach = fisheye_fit.sector_reach_rad[sector];
      reach = std::max(reach, angle_off_axis(point));
      fisheye_fit.widest_corner_rad = std::max(fisheye_fit.widest_corner_rad, reach);
    }
}

// Measures certainty on rings around the axis, a degree apart, as far as the polynomial grows.
void measure_certainty(FisheyeFit& fisheye_fit) {
  const double limit = monotonic_limit_rad(fisheye_fit.intrinsics.k);
  std::vector<glm::dvec3> rays;
  std::vector<double> angles;
  // The camera's rotation is estimated from the angles that the corners have reached.
  for (double angle = 0.5 * pi / 180; angle < fisheye_fit.widest_corner_rad; angle += pi / 180)
    for (int i = 0; i < 16; ++i) {
      const double around = 2 * pi * i / 16;
      rays.emplace_back(std::sin(angle) * std::cos(around), std::sin(angle) * std::sin(around),
                        std::cos(angle));
      angles.push_back(angle);
    }
  fisheye_fit.picture = projection_uncertainty(fisheye_fit.fit, project_fisheye, rays);
  fisheye_fit.uncertain_from_rad = limit;
  for (std::size_t i = 0; i < fisheye_fit.picture.size(); ++i)
    if (fisheye_fit.picture[i].sigma_px > trusted_sigma_px)
      fisheye_fit.uncertain_from_rad = std::min(fisheye_fit.uncertain_from_rad, angles[i]);
}

double trusted_angle(const FisheyeFit& fisheye_fit) {
  auto reach = fisheye_fit.sector_reach_rad;
  std::ranges::sort(reach, std::greater{});
  return std::min(reach[trusted_sectors - 1], fisheye_fit.uncertain_from_rad);
}

}  // namespace

std::optional<tracking::CameraFromWorld> pose_by_rays(const View& view, const Fisheye& lens) {
  std::vector<glm::dvec3> rays;
  glm::dvec3 middle(0);
  for (const glm::dvec2& pixel : view.pixels) {
    const auto ray = lens.unproject(pixel);
    if (!ray) return std::nullopt;
    rays.push_back(*ray);
    middle += *ray;
  }
  if (!(glm::length(middle) > 0)) return std::nullopt;
  const glm::dmat3 turned = glm::mat3_cast(glm::dquat(glm::normalize(middle), glm::dvec3(0, 0, 1)));
  const double behind = std::cos(80 * pi / 180);
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> plane;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const glm::dvec3 ray = turned * rays[i];
    if (ray.z < behind) continue;
    points.emplace_back(view.points[i].x, view.points[i].y, view.points[i].z);
    plane.emplace_back(ray.x / ray.z, ray.y / ray.z);
  }
  cv::Mat turn, shift;
  if (points.size() < 4 || !cv::solvePnP(points, plane, cv::Matx33d::eye(), cv::noArray(), turn,
                                         shift, false, cv::SOLVEPNP_SQPNP))
    return std::nullopt;
  const tracking::CameraFromWorld pose = from_opencv(turn, shift);
  const glm::dmat3 back = glm::transpose(turned);
  return tracking::CameraFromWorld{back * pose.rotation, back * pose.translation};
}

FisheyeIntrinsics fisheye(std::span<const double> lens, int width, int height) {
  return {.width = width,
          .height = height,
          .fx = lens[0],
          .fy = lens[1],
          .cx = lens[2],
          .cy = lens[3],
          .k = {lens[4], lens[5], lens[6], lens[7]},
          .max_angle_rad = pi};
}

FisheyeFit fit_fisheye(const Views& views) {
  FisheyeFit result;
  result.fit = fit_bundle(views.views, started(views), project_fisheye);
  result.intrinsics = fisheye(result.fit.bundle.lens, views.width, views.height);
  result.sigma = lens_sigma(result.fit);
  measure_reach(views, result);
  measure_certainty(result);
  result.intrinsics.max_angle_rad = trusted_angle(result);
  return result;
}

}  // namespace previz::calibrate
