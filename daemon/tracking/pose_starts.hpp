// Closed-form poses from tag corners, to start a refinement from: IPPE and SQPnP.
#pragma once

#include <vector>

#include "daemon/tracking/joint_pose.hpp"

namespace previz::tracking {

// Corner i of a tag in its own frame: lower left, lower right, upper right, upper left.
glm::dvec3 tag_corner(double size_m, std::size_t i);

// Both IPPE poses (Collins and Bartoli 2014) of each of the largest tags in the picture and of all
// corners where they lie nearly in a plane, and SQPnP (Terzakis and Lourakis 2020) over all.
std::vector<CameraFromWorld> pose_starts(const std::vector<TagObservation>& tags,
                                         const PinholeIntrinsics& lens);

}  // namespace previz::tracking
