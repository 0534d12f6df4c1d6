// The registry of display drivers: who can open which display, and which are there.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "drivers/display.hpp"

namespace previz {

struct DisplayDriver {
  const char* name;        // as a set file writes it
  bool drives_connectors;  // its displays are plugged into connectors, and are there for people
  // Throws previz::Error that names the display and says what is wrong.
  std::unique_ptr<Display> (*open)(const DisplaySettings& settings) = nullptr;
  std::vector<FoundDisplay> (*find)() = nullptr;
};

// The drivers that this build has.
std::span<const DisplayDriver> display_drivers();

// The names of all drivers, also of those that this build leaves out.
std::span<const char* const> display_driver_names();

// DisplayDriver::drives_connectors of any driver; false where there is no driver of that name.
bool drives_connectors(std::string_view name);

// Throws previz::Error that says which drivers this build has, if it has not this one.
const DisplayDriver& display_driver(std::string_view name);

}  // namespace previz
