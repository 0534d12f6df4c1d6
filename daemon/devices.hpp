// Implements `previzd devices`, which lists what is plugged in under the names that a set file
// uses.
#pragma once

#include <iosfwd>
#include <stop_token>

namespace previz {

// Prints one line per device: its driver, its stable name and its description. A driver that cannot
// look (no permission, no bus) prints the reason instead.
void list_devices(std::ostream& out);

// Prints the name of every HID button that is pressed, until `stop` is requested. Throws
// previz::Error if there is no device to listen to.
void learn_buttons(std::ostream& out, const std::stop_token& stop);

}  // namespace previz
