// Looks up what a set or a session already knows about the camera being calibrated.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "daemon/core/set/set.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

// Returns the response that the session states; sRGB, clipped where that camera clips by default,
// if the footage is no session, or the session states none. `stream` is "observer" or "light".
ResponseCurve response_of(const std::filesystem::path& footage, const std::string& stream);

// Returns what is known about the light camera's sensor: from the set if it gives a lens, otherwise
// from the session; only sRGB if neither says anything.
LightCameraCalibration light_sensor(const std::optional<std::filesystem::path>& set_file,
                                    const std::filesystem::path& footage);

// Returns the film camera of the set if it gives a lens, otherwise of the session. Throws
// previz::Error if neither has a lens.
ObserverCalibration known_observer(const std::optional<std::filesystem::path>& set_file,
                                   const std::filesystem::path& footage);

// Returns the set's light camera, otherwise the session's. Throws previz::Error if neither has a
// lens.
LightCameraCalibration known_light_camera(const set::Set& set,
                                          const std::filesystem::path& footage);

}  // namespace previz::calibrate
