// Drives a screen on this computer's graphics card without a window system, through DRM/KMS, GBM
// and EGL.
#pragma once

#include <memory>
#include <vector>

#include "drivers/display.hpp"

namespace previz {

// Opens a screen by its connector, "HDMI-A-1" or, if several cards have one of that name,
// "0000:01:00.0/HDMI-A-1". Throws previz::Error that says which connectors there are, or who else
// has the screen.
std::unique_ptr<Display> open_kms(const DisplaySettings& settings);

// Returns every connector, with or without a screen.
std::vector<FoundDisplay> find_kms();

}  // namespace previz
