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
  std::string name;  // name of a line, or of a HID device without the selector
  std::string description;
};

// An open device with one or more buttons. Made for an event loop: one thread owns it, waits on
// fd() together with everything else, and then takes what there is.
class Buttons {
 public:
  virtual ~Buttons() = default;

  // The stable name a set file uses for this device.
  virtual std::string name() const = 0;

  // Returns a descriptor that is readable (POLLIN) whenever next() has something to return; the
  // caller must never read it. It stays valid, and the same, for the object's life.
  virtual int fd() const = 0;

  // Returns the next edge, in order of time; none if none is waiting. Never blocks. A button that
  // is held when the device is lost gets its release first. Nothing follows EndOfStream or trouble
  // with `lost`.
  virtual std::optional<ButtonsEvent> next() = 0;

  // Counts since the object was made; only the thread that owns the object may call this.
  virtual DeviceCounters counters() const { return {}; }
};

}  // namespace previz
