#include "drivers/button_drivers.hpp"

#include <algorithm>
#include <array>
#include <map>

#include "drivers/error.hpp"
#ifdef PREVIZ_WITH_GPIO
#include "drivers/gpio/gpio_buttons.hpp"
#endif
#ifdef PREVIZ_WITH_HID
#include "drivers/hid/hid_buttons.hpp"
#endif
#include "drivers/registry.hpp"

namespace previz {
namespace {

constexpr auto all_button_drivers = std::to_array<ButtonDriver>({
#ifdef PREVIZ_WITH_GPIO
    {"gpio", "gpio:CHIP:LINE", open_gpio, find_gpio, gpio_device_of, nullptr},
#else
    {"gpio", "gpio:CHIP:LINE"},
#endif
#ifdef PREVIZ_WITH_HID
    {"hid", "hid:VENDOR:PRODUCT:SELECTOR", open_hid, find_hid, hid_device_of, hid::learn},
#else
    {"hid", "hid:VENDOR:PRODUCT:SELECTOR"},
#endif
});

// Returns the driver's part of a button's name.
std::string driver_part(const std::string& name) {
  return name.substr(0, name.find(':'));
}

const ButtonDriver* named_by(const std::string& name) {
  const std::string wanted = driver_part(name);
  const auto found = std::ranges::find_if(all_button_drivers, [&](const ButtonDriver& driver) {
    return wanted == driver.name && wanted != name;
  });
  return found == all_button_drivers.end() ? nullptr : &*found;
}

const ButtonDriver& driver_of(const std::string& name) {
  try {
    return driver_named(button_drivers(), driver_part(name), "buttons");
  } catch (const Error& error) {
    throw Error("button \"" + name + "\": " + error.what());
  }
}

}  // namespace

std::span<const ButtonDriver> button_drivers() {
  static const auto drivers = built(all_button_drivers);
  return drivers;
}

bool is_button_name(const std::string& name) {
  return named_by(name) != nullptr;
}

void check_button_name(const std::string& name) {
  if (const ButtonDriver* driver = named_by(name)) {
    if (driver->device_of) driver->device_of(name);
    return;
  }
  std::string forms;
  for (const ButtonDriver& driver : all_button_drivers)
    forms += (forms.empty() ? "" : " | ") + std::string(driver.form);
  throw Error("no button driver matches \"" + name + "\"; allowed: " + forms +
              ", as `previzd devices` prints it");
}

std::vector<std::unique_ptr<Buttons>> open_buttons(std::span<const std::string> names,
                                                   const ButtonSettings& settings) {
  std::map<std::string, std::pair<const ButtonDriver*, std::vector<std::string>>> devices;
  for (const std::string& name : names) {
    const ButtonDriver& driver = driver_of(name);
    auto& [its_driver, its_names] = devices[driver.device_of(name)];
    its_driver = &driver;
    if (std::ranges::find(its_names, name) == its_names.end()) its_names.push_back(name);
  }
  std::vector<std::unique_ptr<Buttons>> buttons;
  for (const auto& [device, of] : devices)
    buttons.push_back(of.first->open(device, of.second, settings));
  return buttons;
}

}  // namespace previz
