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
  std::string known;
  for (const ButtonDriver& driver : all_button_drivers()) {
    if (driver.name == wanted) return driver;
    known += known.empty() ? "" : ", ";
    known += driver.name;
  }
  throw Error("button \"" + name + "\": this build drives no \"" + wanted + "\" buttons; it has " +
              (known.empty() ? "none" : known));
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
