// Gives the shaders the observer's lens: undistorted rays at pixel corners. The camera picture
// itself is never resampled (shaders/README.md, "Camera and depth of field").
#pragma once

#include <glm/vec2.hpp>
#include <vector>

#include "drivers/calibration.hpp"

namespace previz::render {

// Returns (width + 1) * (height + 1) entries, row-major: (x/z, y/z) of the ray through the corner
// (i, j), which is OpenCV pixel position (i - 0.5, j - 0.5). Camera axes x right, y down, z
// forward. Throws previz::Error naming the pixel where the distortion cannot be inverted to 0.01
// px, or not without folding (is_unfolded() of drivers/calibration/pinhole.hpp).
std::vector<glm::vec2> corner_rays(const PinholeIntrinsics& intrinsics);

}  // namespace previz::render
