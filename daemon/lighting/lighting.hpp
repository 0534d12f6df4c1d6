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

// One exposure, or a bracket of several of the same scene, merged into one map (merge_exposures,
// make_resampling, fill_unseen). Resolution 0 gives the smallest power of two whose texels are not
// larger than a pixel on the optical axis, at most 2048.
// The map is what the camera sees from where it stands, at infinity: the real table and cubes near
// it are in it as well. The renderer meets their phantoms before it asks for those directions.
// All frames have the calibration's size; throws previz::Error naming the frame otherwise, and if
// the calibration is not one of a fisheye or its pose not rigid.
Lighting estimate(std::span<const FramePtr> frames, const LightCameraCalibration& calibration,
                  const set::Lighting& settings);

// A latitude-longitude EXR: pixel centre column c, row r of w x h looks towards azimuth
// 2 pi (0.5 - (c + 0.5) / w) from +X to +Y and elevation pi (0.5 - (r + 0.5) / h), Z up; the centre
// of the picture is +X, seen from inside. Bilinear between pixel centres, integrated over each
// texel; turned and scaled by the settings. Resolution 0 gives the smallest power of two whose
// texels are not larger than a pixel on the equator, at most 2048: 512 for 512x256.
// Negative and non-finite values are taken as 0 and noted. Throws previz::Error naming the file and
// what is wrong with it; the channels allowed are R, G and B (others are ignored), or Y.
Lighting load_environment(const set::Lighting& settings);

}  // namespace previz::lighting
