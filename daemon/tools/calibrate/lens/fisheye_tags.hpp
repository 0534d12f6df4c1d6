// Detects AprilTags in a fisheye's picture, where their edges are straight.
#pragma once

#include <vector>

#include "daemon/core/tracking/tag_detector.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::calibrate {

// Resamples the picture to pinhole views of 90 degrees, one along the axis and six around it at 60
// degrees, up to 105 degrees off axis. The ordinary detector finds and measures the tags there, and
// the corners are brought back by the lens. A tag in several views is taken from the view whose
// centre it is nearest to. Tags that cannot be measured (TagDetection::trouble) are left out. The
// corners are in the fisheye's pixels; their covariance stays as measured, in px of the resampled
// view, which has the scale of the fisheye's axis.
std::vector<tracking::TagDetection> detect_in_fisheye(const Frame& frame,
                                                      const FisheyeIntrinsics& intrinsics,
                                                      const ResponseCurve& response,
                                                      const tracking::DetectorSettings& settings);

}  // namespace previz::calibrate
