// Computes where a carrier is, from the camera's pose on the stage and the camera's pose among the
// carrier's tags.
#pragma once

#include "daemon/core/tracking/tracker.hpp"

namespace previz::tracking {

// `on_stage` has world_from_camera; `on_carrier` has carrier_from_camera in its place. Their errors
// come from different corners of the picture and are independent: both covariances are along the
// camera's axes, where they are added, and are brought into the carrier's frame by the adjoint
// (Barfoot, State Estimation for Robotics, 7.3.1).
CarrierPose carrier_pose(const Pose& on_stage, const Pose& on_carrier);

}  // namespace previz::tracking
