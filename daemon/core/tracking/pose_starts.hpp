// Computes closed-form poses from tag corners, as starts of a refinement: IPPE and SQPnP.
#pragma once

#include <vector>

#include "daemon/core/tracking/camera_pose.hpp"
#include "daemon/core/tracking/tag_observation.hpp"
#include "drivers/calibration.hpp"

namespace previz::tracking {

// Returns corner i of a tag in the tag's own frame: lower left, lower right, upper right, upper
// left.
glm::dvec3 tag_corner(double size_m, std::size_t i);

// Returns both IPPE poses (Collins and Bartoli 2014) of each of the largest tags in the picture,
// both of all corners together where they lie nearly in a plane, and SQPnP (Terzakis and Lourakis
// 2020) over all corners.
std::vector<CameraFromWorld> pose_starts(const std::vector<TagObservation>& tags,
                                         const PinholeIntrinsics& lens);

}  // namespace previz::tracking
