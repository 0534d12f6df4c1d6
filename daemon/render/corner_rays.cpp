#include "daemon/render/corner_rays.hpp"

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <string>

#include "drivers/error.hpp"

namespace previz::render {

namespace {

// Projects forward, to check the inverse (OpenCV's model; Brown 1966, Conrady 1919).
cv::Point2d project(const PinholeIntrinsics& k, double x, double y) {
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k.k1 + r2 * (k.k2 + r2 * k.k3));
  const double xd = x * radial + 2 * k.p1 * x * y + k.p2 * (r2 + 2 * x * x);
  const double yd = y * radial + k.p1 * (r2 + 2 * y * y) + 2 * k.p2 * x * y;
  return {k.fx * xd + k.cx, k.fy * yd + k.cy};
}

}  // namespace

std::vector<glm::vec2> corner_rays(const PinholeIntrinsics& k) {
  std::vector<cv::Point2d> corners;
  corners.reserve(static_cast<std::size_t>(k.width + 1) * (k.height + 1));
  for (int j = 0; j <= k.height; ++j)
    for (int i = 0; i <= k.width; ++i) corners.emplace_back(i - 0.5, j - 0.5);

  const cv::Matx33d camera(k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1);
  const cv::Vec<double, 5> distortion(k.k1, k.k2, k.p1, k.p2, k.k3);
  const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-10);
  std::vector<cv::Point2d> rays;
  cv::undistortPoints(corners, rays, camera, distortion, cv::noArray(), cv::noArray(), until);

  std::vector<glm::vec2> result;
  result.reserve(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const cv::Point2d off = project(k, rays[i].x, rays[i].y) - corners[i];
    if (!(std::hypot(off.x, off.y) < 0.01))
      throw Error("observer.intrinsics: the distortion cannot be inverted at pixel (" +
                  std::to_string(corners[i].x) + ", " + std::to_string(corners[i].y) +
                  "); recalibrate the lens or lower its radial terms");
    result.emplace_back(rays[i].x, rays[i].y);
  }
  return result;
}

}  // namespace previz::render
