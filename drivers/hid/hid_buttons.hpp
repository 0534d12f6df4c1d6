// Drives foot pedals, macro pads and game pads through hidapi.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "drivers/button_settings.hpp"
#include "drivers/buttons.hpp"
#include "drivers/debouncer.hpp"
#include "drivers/hid/selector.hpp"

namespace previz {

// `device` is "hid:VENDOR:PRODUCT" or "hid:VENDOR:PRODUCT:SERIAL". A device that is not there, or
// is unplugged, is reported as trouble once and looked for every second; its buttons are then
// released. The device is read through hidraw, or through libusb where hidraw may not be opened. A
// report that is too short for one of its buttons is counted and left out. So are the presses of a
// button that babbles (PressLimit), and those for which nobody comes (ButtonQueue).
std::unique_ptr<Buttons> open_hid(const std::string& device, const std::vector<std::string>& names,
                                  const ButtonSettings& settings);

std::vector<FoundButton> find_hid();

std::string hid_device_of(const std::string& name);

namespace hid {

struct Backend;

// Does as open_hid() through these back ends, which must outlive the buttons: a test has its own.
std::unique_ptr<Buttons> open_through(std::span<const Backend> backends, const std::string& device,
                                      const std::vector<std::string>& names);

// Turns HID reports into button events. It needs no device, so that a test can use it alone.
class ReportReader {
 public:
  // Throws previz::Error where a name cannot be understood.
  explicit ReportReader(const std::vector<std::string>& names);

  std::vector<ButtonEvent> read(std::span<const std::uint8_t> report, std::int64_t time_ns);
  std::vector<ButtonEvent> release_all(std::int64_t time_ns);
  std::uint64_t reports_cut_short() const { return reports_cut_short_; }
  std::uint64_t presses_left_out() const { return presses_left_out_; }
  // Returns the buttons that have begun to babble since the last call.
  std::vector<std::string> take_babblers() { return std::exchange(babblers_, {}); }

 private:
  struct Button {
    std::string name;
    Selector selector;
    bool down = false;     // as the last report says
    bool pressed = false;  // as the last event says
    PressLimit limit;
  };

  bool counts(Button& button, std::int64_t time_ns);

  std::vector<Button> buttons_;
  std::vector<std::string> babblers_;
  std::uint64_t reports_cut_short_ = 0, presses_left_out_ = 0;
};

// Reads one device's reports until `stop` returns true; calls `pressed` with the name of each
// button that goes down.
void learn(const std::string& device, const std::function<bool()>& stop,
           const std::function<void(const std::string& name)>& pressed);

}  // namespace hid
}  // namespace previz
