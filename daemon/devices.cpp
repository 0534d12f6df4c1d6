#include "daemon/devices.hpp"

#include <algorithm>
#include <iomanip>
#include <mutex>
#include <ostream>
#include <string>
#include <thread>
#include <vector>

#include "drivers/button_drivers.hpp"
#include "drivers/camera_drivers.hpp"
#include "drivers/display_drivers.hpp"
#include "drivers/error.hpp"
#include "drivers/keys/value.hpp"

namespace previz {
namespace {

void print(std::ostream& out, const std::string& how, const std::string& description) {
  out << "  " << std::left << std::setw(60) << how << ' ' << description << '\n';
}

void list_cameras(std::ostream& out) {
  out << "cameras (driver and device of [observer] or [light_camera])\n";
  std::size_t count = 0;
  for (const CameraDriver& driver : camera_drivers()) {
    for (const FoundCamera& camera : driver.find()) {
      if (!camera.trouble.empty()) {
        out << "  " << camera.driver << ": " << camera.trouble << '\n';
        continue;
      }
      print(out, "driver = \"" + camera.driver + "\", device = " + codec::quote(camera.device),
            camera.description);
      ++count;
    }
  }
  if (count == 0) out << "  none\n";
}

void list_buttons(std::ostream& out) {
  out << "buttons (name of [[button]]; of HID devices with what --learn adds)\n";
  std::size_t count = 0;
  for (const ButtonDriver& driver : button_drivers()) {
    for (const FoundButton& button : driver.find()) {
      print(out, "name = \"" + button.name + "\"", button.description);
      ++count;
    }
  }
  if (count == 0) out << "  none\n";
}

void list_displays(std::ostream& out) {
  out << "displays (driver and connector of [display])\n";
  std::size_t count = 0;
  for (const DisplayDriver& driver : display_drivers()) {
    for (const FoundDisplay& display : driver.find()) {
      print(out,
            "driver = \"" + std::string(driver.name) + "\", connector = \"" + display.connector +
                "\"",
            display.description);
      ++count;
    }
  }
  if (count == 0) out << "  none\n";
}

}  // namespace

void list_devices(std::ostream& out) {
  list_cameras(out);
  list_buttons(out);
  list_displays(out);
}

// Each device is read by a thread of its own. Two interfaces of one device have the same name, and
// only the first of them is read.
void learn_buttons(std::ostream& out, const std::stop_token& stop) {
  std::mutex mutex;
  std::vector<std::jthread> listeners;
  std::vector<std::string> heard;
  for (const ButtonDriver& driver : button_drivers()) {
    if (!driver.learn) continue;
    for (const FoundButton& found : driver.find()) {
      if (std::ranges::find(heard, found.name) != heard.end()) continue;
      heard.push_back(found.name);
      listeners.emplace_back([&, learn = driver.learn, device = found.name] {
        const auto say = [&](const std::string& line) {
          const std::lock_guard lock(mutex);
          out << line << std::endl;
        };
        try {
          learn(
              device, [&] { return stop.stop_requested(); },
              [&](const std::string& name) { say("name = \"" + name + "\""); });
        } catch (const Error& error) {
          say(error.what());
        }
      });
    }
  }
  if (listeners.empty()) throw Error("no HID device was found to learn from");
  const std::lock_guard lock(mutex);
  out << "press one button at a time; Ctrl-C ends" << std::endl;
}

}  // namespace previz
