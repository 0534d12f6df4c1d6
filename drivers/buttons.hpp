// The one interface of buttons, pedals and pads: gpio, hid and replay stand behind it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>

#include "drivers/device.hpp"

namespace previz {

// One edge of one button, after debouncing.
struct ButtonEvent {
  std::string button;  // its name in the set file
  bool pressed = false;
  std::int64_t timestamp_ns = 0;  // CLOCK_MONOTONIC; replay: the recorded session's clock

  friend bool operator==(const ButtonEvent&, const ButtonEvent&) = default;
};

using ButtonsEvent = std::variant<ButtonEvent, EndOfStream, DeviceTrouble>;

// A button that is there now.
struct FoundButton {
  std::string name;  // of a line; of a HID device without the selector
  std::string description;
};

// An open device with one or more buttons. Made for an event loop: one thread owns it, waits on
// fd() together with everything else, and then takes what there is.
class Buttons {
 public:
  virtual ~Buttons() = default;

  // The stable name a set file uses for this device.
  virtual std::string name() const = 0;

  // Readable (POLLIN) whenever next() has something to say; never read it. Valid, and the same, for
  // the object's life.
  virtual int fd() const = 0;

  // The next edge, in order; none where nothing waits. Never blocks. A button held when the device
  // is lost gets its release first. After EndOfStream or trouble that says `lost` nothing follows.
  virtual std::optional<ButtonsEvent> next() = 0;

  // Since the object was made; to be asked by the thread that owns it.
  virtual DeviceCounters counters() const { return {}; }
};

}  // namespace previz
