// `previzd devices`: what is plugged in, by the names a set file takes.
#pragma once

#include <iosfwd>
#include <stop_token>

namespace previz {

// One line a device: its driver, its stable name, what it is. Drivers that cannot look (no
// permission, no bus) say so instead.
void list_devices(std::ostream& out);

// Until stopped, prints the name of every HID button that is pressed.
// Throws previz::Error if there is no device to listen to.
void learn_buttons(std::ostream& out, const std::stop_token& stop);

}  // namespace previz
