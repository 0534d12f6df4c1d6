// A display without a screen: it is drawn like any other (surfaceless EGL) and read back.
#pragma once

#include <memory>
#include <vector>

#include "drivers/display.hpp"

namespace previz {

// Opens a display of the mode's size, or of 1280x720 if none is given. Throws previz::Error if
// there is no EGL.
std::unique_ptr<Display> open_headless(const DisplaySettings& settings);
std::vector<FoundDisplay> find_headless();

}  // namespace previz
