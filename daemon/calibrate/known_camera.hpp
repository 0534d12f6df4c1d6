// What a set or a session already knows of the camera that is calibrated.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "daemon/set/set.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

// By the session that the footage is; sRGB where it is none, or says nothing. `stream` is
// "observer" or "light".
ResponseCurve response_of(const std::filesystem::path& footage, const std::string& stream);

// What is known of the light camera's sensor: the set's, where it gives a lens, otherwise the
// session's; sRGB and no more where neither says anything.
LightCameraCalibration light_sensor(const std::optional<std::filesystem::path>& set_file,
                                    const std::filesystem::path& footage);

// The set's own, otherwise the session's. Throws previz::Error where neither has a lens.
LightCameraCalibration known_light_camera(const set::Set& set,
                                          const std::filesystem::path& footage);

}  // namespace previz::calibrate
