// Prints values as tables of a set file; this is how calibrations print results for the crew to
// paste.
#pragma once

#include <string>

#include "daemon/core/set/set.hpp"

namespace previz::set {

// Each function returns one table with its header, written from the parser's own table of keys:
// parse_set reads the values back, to 12 digits. Keys that hold their default are left out.
std::string intrinsics_toml(const ObserverCalibration& calibration);  // [observer.intrinsics]
std::string intrinsics_toml(
    const LightCameraCalibration& calibration);                        // [light_camera.intrinsics]
std::string lens_fit_toml(const LensFit& fit);                         // [observer.lens_fit]
std::string lens_toml(const ThinLens& lens);                           // [observer.lens]
std::string light_pose_toml(const glm::dmat4& world_from_camera);      // [light_camera.pose]
std::string response_toml(const ObserverCalibration& calibration);     // [observer.response]
std::string response_toml(const LightCameraCalibration& calibration);  // [light_camera.response]
std::string balance_toml(const glm::dvec3& balance);                   // [lighting]
std::string environment_rotation_toml(double rotation_rad);            // [lighting]
// Returns the keys of [quality], [estimator] and [lighting] in which `wanted` is not as `own`, and
// the [[quality.preview]] tables of `wanted`: an overlay that makes the one of the other.
std::string overlay_toml(const Set& own, const Set& wanted);
std::string surface_toml(const Surface& surface);  // [[surface]]

}  // namespace previz::set
