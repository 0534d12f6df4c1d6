// From what the light camera saw, or an EXR environment, to the light around the set (P9).
#pragma once

#include <filesystem>
#include <glm/vec3.hpp>
#include <span>

#include "daemon/lighting/environment.hpp"
#include "daemon/set/set.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::lighting {

// One exposure, or a bracket of several of the same scene, merged into one map. All frames have the
// calibration's size; throws previz::Error naming the frame otherwise.
Lighting estimate(std::span<const FramePtr> frames, const LightCameraCalibration& calibration,
                  const set::Lighting& settings);

// A latitude-longitude EXR: pixel centre column c, row r of w x h looks towards azimuth
// 2 pi (0.5 - (c + 0.5) / w) from +X to +Y and elevation pi (0.5 - (r + 0.5) / h), Z up; the centre
// of the picture is +X, seen from inside. Turned and scaled by the settings.
Lighting load_environment(const set::Lighting& settings);

}  // namespace previz::lighting
