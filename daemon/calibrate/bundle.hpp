// Bundle adjustment of one lens and the poses of the board: what calibrations of both cameras are
// made by.
#pragma once

#include <functional>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/calibrate/views.hpp"
#include "daemon/tracking/joint_pose.hpp"

namespace previz::calibrate {

// The pixel of a point in camera axes; nothing where the lens cannot see it.
using Projection =
    std::function<std::optional<glm::dvec2>(std::span<const double> lens, const glm::dvec3& point)>;

struct Bundle {
  std::vector<double> lens;
  std::vector<tracking::CameraFromWorld> poses;  // camera from board, one a view
};

struct BundleFit {
  Bundle bundle;
  // Of each view's corners: measured - projected, px, and whether it counted.
  std::vector<std::vector<glm::dvec2>> residuals;
  std::vector<std::vector<bool>> used;
  std::size_t corners = 0, corners_used = 0;
  std::vector<std::size_t> views_left_out;
  double rms_px = 0;      // of the used corners' distances, as OpenCV counts
  double rms_all_px = 0;  // of every corner, at the same parameters
  double sigma_px = 0;    // of a coordinate, from the residuals and their degrees of freedom
  std::vector<double> lens_covariance;                // row-major
  std::vector<std::vector<double>> pose_covariances;  // 6x6: turn (rad), shift, camera axes
};

// A lens that is known has no parameters: then the poses alone are fitted.
// Least squares over all used corners' distances in px (Levenberg-Marquardt, derivatives by central
// differences). Then corners are left out that are farther off than 4.5 robust standard deviations
// (from the median distance; of corners that are right, 1 in 25 000 is) and than 1 px: a corner
// that was mistaken is, and what a lens model cannot say is not to be hidden. Views with more than
// half of their corners left out are left out whole, and the fit is done again until nothing
// changes. Throws previz::Error if the corners do not determine the lens.
BundleFit fit_bundle(const std::vector<View>& views, Bundle start, const Projection& projection);

// Standard deviations of the lens's parameters.
std::vector<double> lens_sigma(const BundleFit& fit);

}  // namespace previz::calibrate
