// A screen on this computer's graphics card, without a window system: DRM/KMS, GBM and EGL.
#pragma once

#include <memory>
#include <vector>

#include "drivers/display.hpp"

namespace previz {

// By its connector, "HDMI-A-1" or, where several cards have one of that name,
// "0000:01:00.0/HDMI-A-1". Throws previz::Error saying which connectors there are, or who else has
// the screen.
std::unique_ptr<Display> open_kms(const DisplaySettings& settings);

// Every connector, with or without a screen.
std::vector<FoundDisplay> find_kms();

}  // namespace previz
