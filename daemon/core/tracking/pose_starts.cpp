#include "daemon/core/tracking/pose_starts.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <opencv2/calib3d.hpp>

#include "drivers/calibration/pinhole.hpp"

namespace previz::tracking {
namespace {

constexpr std::size_t kMaxTags = 8;                    // tags that give starts of their own
constexpr double kNearlyPlanar = 0.05;                 // least over middle extent of all corners
constexpr std::size_t kSquareOrder[4] = {3, 2, 1, 0};  // as SOLVEPNP_IPPE_SQUARE wants them

// Returns every pose that the method finds, as camera_from_object.
std::vector<CameraFromWorld> solve(const std::vector<cv::Point3d>& object,
                                   const std::vector<cv::Point2d>& rays,
                                   cv::SolvePnPMethod method) {
  std::vector<CameraFromWorld> poses;
  std::vector<cv::Mat> rotations, translations;
  try {
    cv::solvePnPGeneric(object, rays, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotations,
                        translations, false, method);
  } catch (const cv::Exception&) {
    return poses;  // a degenerate picture; other starts remain
  }
  for (std::size_t k = 0; k < rotations.size(); ++k) {
    cv::Matx33d r;
    cv::Rodrigues(rotations[k], r);
    CameraFromWorld pose;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) pose.rotation[j][i] = r(i, j);
      pose.translation[i] = translations[k].at<double>(i);
    }
    const double sum =
        glm::dot(pose.rotation[0], pose.rotation[0]) + glm::dot(pose.translation, pose.translation);
    if (std::isfinite(sum)) poses.push_back(pose);
  }
  return poses;
}

// Composes camera_from_object with object_from_world.
CameraFromWorld compose(const CameraFromWorld& a, const glm::dmat3& rotation,
                        glm::dvec3 translation) {
  return {a.rotation * rotation, a.rotation * translation + a.translation};
}

double side_px(const TagObservation& tag) {
  return glm::distance(tag.corners[0], tag.corners[2]) +
         glm::distance(tag.corners[1], tag.corners[3]);
}

// All corners in the axes of their own plane, and their flatness (0: exactly flat).
struct PlaneFrame {
  glm::dmat3 world_from_plane{1.0};
  glm::dvec3 origin{0};
  double flatness = 1;
};

PlaneFrame plane_of(const std::vector<glm::dvec3>& points) {
  PlaneFrame frame;
  for (const glm::dvec3& p : points) frame.origin += p / double(points.size());
  cv::Matx33d spread = cv::Matx33d::zeros();
  for (const glm::dvec3& p : points) {
    const glm::dvec3 d = p - frame.origin;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) spread(i, j) += d[i] * d[j];
  }
  cv::Vec3d extent;
  cv::Matx33d axes;  // rows, largest first
  cv::eigen(spread, extent, axes);
  const glm::dvec3 x(axes(0, 0), axes(0, 1), axes(0, 2)), y(axes(1, 0), axes(1, 1), axes(1, 2));
  frame.world_from_plane = glm::dmat3(x, y, glm::cross(x, y));
  if (extent[1] > 0) frame.flatness = std::sqrt(std::max(0.0, extent[2]) / extent[1]);
  return frame;
}

}  // namespace

glm::dvec3 tag_corner(double size_m, std::size_t i) {
  const double h = size_m / 2;
  return {i == 1 || i == 2 ? h : -h, i >= 2 ? h : -h, 0};
}

std::vector<CameraFromWorld> pose_starts(const std::vector<TagObservation>& tags,
                                         const PinholeIntrinsics& lens) {
  struct Measured {
    const TagObservation* tag;
    std::array<cv::Point2d, 4> rays;
  };
  std::vector<Measured> measured;
  for (const TagObservation& tag : tags) {
    Measured m{&tag, {}};
    bool valid = true;
    for (std::size_t i = 0; i < 4; ++i) {
      const auto ray = undistort(lens, tag.corners[i]);
      valid = valid && ray;
      if (ray) m.rays[i] = {ray->x, ray->y};
    }
    if (valid) measured.push_back(m);
  }
  std::stable_sort(measured.begin(), measured.end(), [](const Measured& a, const Measured& b) {
    return side_px(*a.tag) > side_px(*b.tag);
  });

  std::vector<CameraFromWorld> starts;
  for (std::size_t k = 0; k < std::min(kMaxTags, measured.size()); ++k) {
    const TagObservation& tag = *measured[k].tag;
    std::vector<cv::Point3d> object;
    std::vector<cv::Point2d> rays;
    for (std::size_t i : kSquareOrder) {
      const glm::dvec3 c = tag_corner(tag.size_m, i);
      object.emplace_back(c.x, c.y, 0);
      rays.push_back(measured[k].rays[i]);
    }
    const glm::dmat3 tag_from_world = glm::transpose(glm::dmat3(tag.world_from_tag));
    const glm::dvec3 origin = tag_from_world * -glm::dvec3(tag.world_from_tag[3]);
    for (const CameraFromWorld& p : solve(object, rays, cv::SOLVEPNP_IPPE_SQUARE))
      starts.push_back(compose(p, tag_from_world, origin));
  }
  if (measured.size() < 2) return starts;

  std::vector<glm::dvec3> world;
  std::vector<cv::Point2d> rays;
  for (const Measured& m : measured) {
    for (std::size_t i = 0; i < 4; ++i) {
      world.emplace_back(m.tag->world_from_tag * glm::dvec4(tag_corner(m.tag->size_m, i), 1));
      rays.push_back(m.rays[i]);
    }
  }
  const PlaneFrame plane = plane_of(world);
  const glm::dmat3 plane_from_world = glm::transpose(plane.world_from_plane);
  const glm::dvec3 origin = plane_from_world * -plane.origin;
  std::vector<cv::Point3d> object;
  for (const glm::dvec3& w : world) {
    const glm::dvec3 p = plane_from_world * (w - plane.origin);
    object.emplace_back(p.x, p.y, p.z);
  }
  for (const CameraFromWorld& p : solve(object, rays, cv::SOLVEPNP_SQPNP))
    starts.push_back(compose(p, plane_from_world, origin));
  if (plane.flatness < kNearlyPlanar) {
    for (cv::Point3d& p : object) p.z = 0;
    for (const CameraFromWorld& p : solve(object, rays, cv::SOLVEPNP_IPPE))
      starts.push_back(compose(p, plane_from_world, origin));
  }
  return starts;
}

}  // namespace previz::tracking
