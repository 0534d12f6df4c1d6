// Bundle adjustment of one lens and the poses of the board; the calibrations of both cameras use
// it.
#pragma once

#include <functional>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/core/tracking/joint_pose.hpp"
#include "daemon/tools/calibrate/lens/views.hpp"

namespace previz::calibrate {

// Returns the pixel of a point in camera axes; nothing if the lens cannot see the point.
using Projection =
    std::function<std::optional<glm::dvec2>(std::span<const double> lens, const glm::dvec3& point)>;

struct Bundle {
  std::vector<double> lens;
  std::vector<tracking::CameraFromWorld> poses;  // camera from board, one per view
};

struct BundleFit {
  Bundle bundle;
  // For each corner of each view: measured - projected, px, and whether the corner was used.
  std::vector<std::vector<glm::dvec2>> residuals;
  std::vector<std::vector<bool>> used;
  std::size_t corners = 0, corners_used = 0;
  std::vector<std::size_t> views_left_out;
  double rms_px = 0;                    // of the used corners' distances, as OpenCV computes it
  double rms_all_px = 0;                // of every corner, at the same parameters
  double sigma_px = 0;                  // of one coordinate, from residuals and degrees of freedom
  std::vector<double> lens_covariance;  // row-major
  std::vector<std::vector<double>> pose_covariances;  // 6x6: rotation (rad), shift, camera axes
};

// Fits lens and poses. A known lens has no parameters, so only the poses are fitted.
// The fit is least squares over all used corners' distances in px (Levenberg-Marquardt, derivatives
// by central differences). Then outliers are dropped: corners farther off than 4.5 robust standard
// deviations (from the median distance; 1 good corner in 25 000 is) and than 1 px, so that mistaken
// corners go, but what the lens model cannot express is not hidden. Views that lose more than half
// of their corners are left out whole, and the fit is repeated until nothing changes. Throws
// previz::Error if the corners do not determine the lens.
BundleFit fit_bundle(const std::vector<View>& views, Bundle start, const Projection& projection);

// Returns the standard deviations of the lens's parameters.
std::vector<double> lens_sigma(const BundleFit& fit);

}  // namespace previz::calibrate
