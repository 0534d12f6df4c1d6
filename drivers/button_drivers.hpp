// The registry of button drivers: from the names in a set to open devices.
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
//   hid:VENDOR:PRODUCT:SELECTOR    of the first such device; hexadecimal; see hid/selector.hpp
//   hid:VENDOR:PRODUCT:SERIAL:SELECTOR

// Whether the name begins with that of a driver, also of one that this build leaves out.
bool is_button_name(const std::string& name);

// Throws previz::Error that says what is allowed, if no driver takes the name.
void check_button_name(const std::string& name);

struct ButtonDriver {
  const char* name;
  const char* form;  // of its buttons' names, for people
  // Opens one device with its buttons, full names of that device. What is not there, or goes away,
  // is reported as trouble and waited for. Throws previz::Error where a name cannot be understood.
  std::unique_ptr<Buttons> (*open)(const std::string& device, const std::vector<std::string>& names,
                                   const ButtonSettings& settings) = nullptr;
  std::vector<FoundButton> (*find)() = nullptr;
  // The device part of a name. Throws previz::Error where it cannot be understood.
  std::string (*device_of)(const std::string& name) = nullptr;
  // Reads a device until `stop` says so; calls back with the name of each button that goes down.
  // Throws previz::Error where it cannot be read. Null where names need no learning.
  void (*learn)(const std::string& device, const std::function<bool()>& stop,
                const std::function<void(const std::string& name)>& pressed) = nullptr;
};

// The drivers that this build has.
std::span<const ButtonDriver> button_drivers();

// Each device once, with all its buttons among `names`. Throws previz::Error naming the button
// whose driver this build has not, or that cannot be understood.
std::vector<std::unique_ptr<Buttons>> open_buttons(std::span<const std::string> names,
                                                   const ButtonSettings& settings);

}  // namespace previz
