// The light camera's Kannala-Brandt fisheye from views of a board, exact beyond 90 degrees.
#pragma once

#include <array>
#include <vector>

#include "daemon/calibrate/bundle.hpp"
#include "daemon/calibrate/uncertainty.hpp"
#include "daemon/calibrate/views.hpp"
#include "drivers/calibration.hpp"
#include "drivers/calibration/fisheye.hpp"

namespace previz::calibrate {

inline constexpr std::array fisheye_parameters = {"fx", "fy", "cx", "cy", "k1", "k2", "k3", "k4"};

struct FisheyeFit {
  // max_angle_rad: the angle up to which the calibration is trusted; see fit_fisheye.
  FisheyeIntrinsics intrinsics;
  BundleFit fit;              // lens in the order of fisheye_parameters
  std::vector<double> sigma;  // standard deviations, in that order
  std::vector<UncertainPixel> picture;
  double widest_corner_rad = 0;              // of those used
  std::array<double, 8> sector_reach_rad{};  // the same in sectors of 45 degrees around the axis
  double uncertain_from_rad = 0;             // where the projection is less certain than 1 px
};

// Starts from equidistant lenses (r = f t) of several focal lengths, about the picture's middle,
// with each board posed by the rays of its corners; the best of these is refined over all corners
// by fit_bundle. No step goes by way of a plane in front of the camera, so corners beyond 90
// degrees are as good as others (cv::fisheye clamps or mirrors them). Trusted is what corners have
// been seen to reach in at least 3 of 8 sectors around the axis (the model is round, but its centre
// must hold too), as long as the polynomial grows there and the projection is certain to 1 px.
// Throws previz::Error if the views cannot determine a lens at all; whether they do it well is for
// missing_views (coverage.hpp) to say.
FisheyeFit fit_fisheye(const Views& views);

// The pose that explains where the rays of a view's corners point, to start from: SQPnP (Terzakis
// and Lourakis 2020) in a pinhole camera turned towards their middle. Corners more than 80 degrees
// off that middle are left to a refinement. Nothing where the lens does not reach a corner.
std::optional<tracking::CameraFromWorld> pose_by_rays(const View& view, const Fisheye& lens);

FisheyeIntrinsics fisheye(std::span<const double> lens, int width, int height);

}  // namespace previz::calibrate
