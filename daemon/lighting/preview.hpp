// An environment map as pictures that people and other programs can look at.
#pragma once

#include "daemon/lighting/environment.hpp"
#include "daemon/lighting/exr_picture.hpp"
#include "drivers/frame.hpp"

namespace previz::lighting {

// Latitude-longitude picture, twice as wide as high, laid out as load_environment reads it: means
// over 4x4 directions a pixel.
LinearPicture to_latitude_longitude(const EnvironmentMap& map, int width);

// 8-bit sRGB for the eye: scaled so that the mean of log luminance becomes 0.18, then L / (1 + L)
// on luminance.
Plate tone_map(const LinearPicture& picture);

}  // namespace previz::lighting
