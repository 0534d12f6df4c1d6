// Drives buttons, pedals and switches on GPIO lines through libgpiod.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "drivers/button_settings.hpp"
#include "drivers/buttons.hpp"

namespace previz {

// `device` is "gpio:CHIP". Edges come from the kernel with their time; a chip or line that is not
// there, or is in use, is reported as trouble once and tried again every second.
std::unique_ptr<Buttons> open_gpio(const std::string& device, const std::vector<std::string>& names,
                                   const ButtonSettings& settings);

// Returns the named input lines that nobody uses.
std::vector<FoundButton> find_gpio();

std::string gpio_device_of(const std::string& name);

}  // namespace previz
