// The registry of display drivers: who can open which display, and which are there.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "drivers/display.hpp"

namespace previz {

struct DisplayDriver {
  std::string_view name;
  // Throws previz::Error that names the display and says what is wrong.
  std::unique_ptr<Display> (*open)(const DisplaySettings& settings);
  std::vector<FoundDisplay> (*find)();
};

// Those this build has.
std::span<const DisplayDriver> display_drivers();

// Throws previz::Error that says which drivers this build has, if it has not this one.
const DisplayDriver& display_driver(std::string_view name);

}  // namespace previz
