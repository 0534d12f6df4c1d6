// The registry of display drivers: who can open which display, and which are there.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "drivers/display.hpp"

namespace previz {

// What a set asks of a display. Plain data.
struct DisplaySettings {
  std::string connector;            // its stable name; empty: the first that has a screen
  std::optional<DisplayMode> mode;  // absent: what the screen prefers; 0 Hz: the highest rate
  DisplayScale scale = DisplayScale::letterbox;
};

// A display that is there now.
struct FoundDisplay {
  std::string connector;    // its stable name
  std::string description;  // what is plugged in, and its modes
};

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
