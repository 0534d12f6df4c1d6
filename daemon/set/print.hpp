// Tables of a set file from values: what a calibration prints, for the crew to paste.
#pragma once

#include <string>

#include "daemon/set/set.hpp"

namespace previz::set {

// Each is one table with its header, by the parser's own table of keys: parse_set reads back what
// was printed, to 12 digits. Keys that hold their default are left out.
std::string intrinsics_toml(const PinholeIntrinsics& intrinsics);      // [observer.intrinsics]
std::string intrinsics_toml(const FisheyeIntrinsics& intrinsics);      // [light_camera.intrinsics]
std::string lens_toml(const ThinLens& lens);                           // [observer.lens]
std::string light_pose_toml(const glm::dmat4& world_from_camera);      // [light_camera.pose]
std::string response_toml(const ObserverCalibration& calibration);     // [observer.response]
std::string response_toml(const LightCameraCalibration& calibration);  // [light_camera.response]

}  // namespace previz::set
