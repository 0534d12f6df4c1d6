// The registry of display drivers, which open displays and list those that are there.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "drivers/display.hpp"

namespace previz {

struct DisplayDriver {
  const char* name;        // as a set file writes it
  bool drives_connectors;  // its displays are screens on connectors, for people to see
  // Throws previz::Error that names the display and says what is wrong.
  std::unique_ptr<Display> (*open)(const DisplaySettings& settings) = nullptr;
  std::vector<FoundDisplay> (*find)() = nullptr;
};

// Returns the drivers that this build has.
std::span<const DisplayDriver> display_drivers();

// Returns the names of all drivers, including those that this build leaves out.
std::span<const char* const> display_driver_names();

// Returns DisplayDriver::drives_connectors of any driver; false if there is no driver of that name.
bool drives_connectors(std::string_view name);

// Throws previz::Error that lists the drivers of this build if this one is not among them.
const DisplayDriver& display_driver(std::string_view name);

}  // namespace previz
