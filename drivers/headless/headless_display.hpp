// A display without a screen: drawn like any other (surfaceless EGL), to be read back.
#pragma once

#include <memory>
#include <vector>

#include "drivers/display.hpp"

namespace previz {

// Of the mode's size, 1280x720 where none is given. Throws previz::Error where there is no EGL.
std::unique_ptr<Display> open_headless(const DisplaySettings& settings);
std::vector<FoundDisplay> find_headless();

}  // namespace previz
