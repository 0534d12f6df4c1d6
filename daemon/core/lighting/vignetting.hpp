// Compensates the light that a fisheye lens loses towards its edge.
#pragma once

#include <vector>

#include "daemon/core/lighting/hdr.hpp"
#include "drivers/calibration/fisheye.hpp"

namespace previz::lighting {

// Returns for each pixel 1 / relative_illumination at its centre; 1 where the lens sees nothing.
// Empty for a lens without vignetting.
std::vector<float> vignetting_gains(const Fisheye& lens, const Vignetting& vignetting);

void undo_vignetting(const std::vector<float>& gains, HdrPicture& picture);

}  // namespace previz::lighting
