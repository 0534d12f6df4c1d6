// The camera's pose from AprilTags of a known map: all of them in one joint PnP (P12).
#pragma once

#include <memory>

#include "daemon/set/set.hpp"
#include "daemon/tracking/tracker.hpp"
#include "drivers/calibration.hpp"

namespace previz::tracking {

std::unique_ptr<Tracker> make_apriltag_tracker(const set::Tracking& settings,
                                               const PinholeIntrinsics& intrinsics,
                                               const ResponseCurve& response = {});

}  // namespace previz::tracking
