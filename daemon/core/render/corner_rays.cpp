#include "daemon/core/render/corner_rays.hpp"

#include <glm/geometric.hpp>
#include <opencv2/calib3d.hpp>
#include <optional>
#include <string>

#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"

namespace previz::render {

std::vector<glm::vec2> corner_rays(const PinholeIntrinsics& k) {
  std::vector<cv::Point2d> corners;
  corners.reserve(static_cast<std::size_t>(k.width + 1) * (k.height + 1));
  for (int j = 0; j <= k.height; ++j)
    for (int i = 0; i <= k.width; ++i) corners.emplace_back(i - 0.5, j - 0.5);

  const cv::Matx33d camera(k.fx, 0, k.cx, 0, k.fy, k.cy, 0, 0, 1);
  const cv::Vec<double, 8> distortion(k.k1, k.k2, k.p1, k.p2, k.k3, k.k4, k.k5, k.k6);
  const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 100, 1e-10);
  std::vector<cv::Point2d> rays;
  cv::undistortPoints(corners, rays, camera, distortion, cv::noArray(), cv::noArray(), until);

  std::vector<glm::vec2> result;
  result.reserve(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const glm::dvec2 corner(corners[i].x, corners[i].y);
    std::optional<glm::dvec2> ray({rays[i].x, rays[i].y});
    // OpenCV's iteration does not converge everywhere, and may end where the lens has folded.
    if (!(glm::distance(distort(k, *ray), corner) < 0.01) || !is_unfolded(k, *ray, corner))
      ray = undistort(k, corner);
    if (!ray)
      throw Error("observer.intrinsics: the distortion cannot be inverted at pixel (" +
                  std::to_string(corner.x) + ", " + std::to_string(corner.y) +
                  "); recalibrate the lens or lower its radial terms");
    result.emplace_back(*ray);
  }
  return result;
}

}  // namespace previz::render
