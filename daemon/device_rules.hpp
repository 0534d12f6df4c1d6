// Prints the udev rules that open HID devices and GPIO chips to the service.
#pragma once

#include <filesystem>
#include <iosfwd>

namespace previz {

// Prints a rule for each kind of HID device and each GPIO chip that is plugged in, with a comment
// that says what it is. The rule of a keyboard is a comment itself, because whoever may open a
// keyboard reads what is typed on it. `sysfs` is where the kernel lists its devices.
void print_device_rules(std::ostream& out, const std::filesystem::path& sysfs = "/sys");

}  // namespace previz
