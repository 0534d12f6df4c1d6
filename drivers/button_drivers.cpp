#include "drivers/button_drivers.hpp"

#include <algorithm>
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

const std::vector<ButtonDriver>& all_button_drivers() {
  static const std::vector<ButtonDriver> all{
#ifdef PREVIZ_WITH_GPIO
      {"gpio", open_gpio, find_gpio, gpio_device_of, nullptr},
#endif
#ifdef PREVIZ_WITH_HID
      {"hid", open_hid, find_hid, hid_device_of, hid::learn},
#endif
  };
  return all;
}

const ButtonDriver& driver_of(const std::string& name) {
  const std::string wanted = name.substr(0, name.find(':'));
  try {
    return driver_named(all_button_drivers(), wanted, "buttons");
  } catch (const Error& error) {
    throw Error("button \"" + name + "\": " + error.what());
  }
}

}  // namespace

std::span<const ButtonDriver> button_drivers() {
  return all_button_drivers();
}

bool is_button_name(const std::string& name) {
  return name.starts_with("gpio:") || name.starts_with("hid:");
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
