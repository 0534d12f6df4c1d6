// Fits a lens of one of previzd's two models to a lens of the other.
#pragma once

#include <glm/vec2.hpp>

#include "drivers/calibration.hpp"

namespace previz::calibrate {

template <typename Intrinsics>
struct Refit {
  Intrinsics lens;
  // The largest distance between the pixels of one direction by the two lenses, on a grid of 257 x
  // 257 pixels over the whole picture, edges included; infinite where the new lens has nothing.
  double worst_px = 0;
  glm::dvec2 worst_pixel{};
};

// Least squares over a grid of the picture's pixels: the directions that the old lens gives them
// are projected by the new one. Throw previz::Error naming a pixel whose direction the new model
// cannot hold: for a pinhole, one that the fisheye does not see or that is 90 degrees or more off
// axis. The old lens must be complete (lens_file_check.hpp).
// The pinhole keeps focal lengths and principal point; its k1..k6 are found by the linearised
// rational fit of Sanathanan and Koerner 1963. A fisheye's eight parameters are found by
// Gauss-Newton, because tangential distortion shifts its centre; its max_angle_rad is that of the
// farthest corner.
Refit<PinholeIntrinsics> refit_as_pinhole(const FisheyeIntrinsics& lens);
Refit<FisheyeIntrinsics> refit_as_fisheye(const PinholeIntrinsics& lens);

}  // namespace previz::calibrate
