// The registry of button drivers, which opens the devices of the buttons that a set names.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "drivers/button_settings.hpp"
#include "drivers/buttons.hpp"

namespace previz {

// A button's name is DRIVER:DEVICE:BUTTON, as `previzd devices` prints it:
//   gpio:CHIP:LINE                 CHIP by its label, LINE by its name or offset
//   hid:VENDOR:PRODUCT:SELECTOR    the first such device; hexadecimal ids; see hid/selector.hpp
//   hid:VENDOR:PRODUCT:SERIAL:SELECTOR

// Returns whether the name begins with that of a driver, even one that this build leaves out.
bool is_button_name(const std::string& name);

// Throws previz::Error that says what is allowed, if no driver takes the name.
void check_button_name(const std::string& name);

struct ButtonDriver {
  const char* name;
  const char* form;  // how its buttons are named, for messages
  // Opens one device for the buttons `names`, which are full names of that device. A device that is
  // missing or goes away is reported as trouble and waited for. Throws previz::Error if a name
  // cannot be understood.
  std::unique_ptr<Buttons> (*open)(const std::string& device, const std::vector<std::string>& names,
                                   const ButtonSettings& settings) = nullptr;
  std::vector<FoundButton> (*find)() = nullptr;
  // Returns the device part of a name. Throws previz::Error if the name cannot be understood.
  std::string (*device_of)(const std::string& name) = nullptr;
  // Reads a device until `stop` returns true; calls `pressed` with the name of each button that
  // goes down. Throws previz::Error if the device cannot be read. Null if names need no learning.
  void (*learn)(const std::string& device, const std::function<bool()>& stop,
                const std::function<void(const std::string& name)>& pressed) = nullptr;
};

// Returns the drivers that this build has.
std::span<const ButtonDriver> button_drivers();

// Opens each device once, with all its buttons among `names`. Throws previz::Error that names the
// button if this build lacks its driver or its name cannot be understood.
std::vector<std::unique_ptr<Buttons>> open_buttons(std::span<const std::string> names,
                                                   const ButtonSettings& settings);

}  // namespace previz
