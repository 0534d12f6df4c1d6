// Fits the light camera's Kannala-Brandt fisheye to views of a board, exactly even beyond 90
// degrees.
#pragma once

#include <array>
#include <vector>

#include "daemon/tools/calibrate/lens/bundle.hpp"
#include "daemon/tools/calibrate/lens/uncertainty.hpp"
#include "daemon/tools/calibrate/lens/views.hpp"
#include "drivers/calibration.hpp"
#include "drivers/calibration/fisheye.hpp"

namespace previz::calibrate {

inline constexpr std::array fisheye_parameters = {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};

struct FisheyeFit {
  // max_angle_rad is the angle up to which the calibration is trusted; see fit_fisheye.
  FisheyeIntrinsics intrinsics;
  BundleFit fit;              // lens in the order of fisheye_parameters
  std::vector<double> sigma;  // standard deviations, in that order
  std::vector<UncertainPixel> picture;
  double widest_corner_rad = 0;              // among the used corners
  std::array<double, 8> sector_reach_rad{};  // the same by sector of 45 degrees around the axis
  double uncertain_from_rad = 0;  // from here on the projection is less certain than 1 px
};

// Starts from equidistant lenses (r = f t) of several focal lengths, centred in the picture, with
// each board posed by the rays of its corners; fit_bundle refines the best of these over all
// corners. No step goes through a plane in front of the camera, so corners beyond 90 degrees are as
// good as others (cv::fisheye clamps or mirrors them). The lens is trusted up to the angle that
// corners reach in at least 3 of 8 sectors around the axis (the model is round, but its centre must
// be right too), as long as the polynomial grows there and the projection is certain to 1 px.
// Throws previz::Error if the views cannot determine a lens at all; missing_views (coverage.hpp)
// decides whether they determine it well.
FisheyeFit fit_fisheye(const Views& views);

// Returns a pose to start from that explains where the rays of a view's corners point: SQPnP
// (Terzakis and Lourakis 2020) in a pinhole camera turned towards their middle. Corners more than
// 80 degrees off that middle are left to a refinement. Returns nothing if the lens does not reach a
// corner.
std::optional<tracking::CameraFromWorld> pose_by_rays(const View& view, const Fisheye& lens);

FisheyeIntrinsics fisheye(std::span<const double> lens, int width, int height);

}  // namespace previz::calibrate
