// Where a carrier is, from the camera's pose on the stage and its pose among the carrier's tags.
#pragma once

#include "daemon/tracking/tracker.hpp"

namespace previz::tracking {

// `on_stage` has world_from_camera; `on_carrier` has carrier_from_camera in its place. Their errors
// are of different corners of the picture, and independent: both covariances are along the camera's
// axes, add up there, and are brought into the carrier's frame by its adjoint (Barfoot, State
// Estimation for Robotics, 7.3.1).
CarrierPose carrier_pose(const Pose& on_stage, const Pose& on_carrier);

}  // namespace previz::tracking
