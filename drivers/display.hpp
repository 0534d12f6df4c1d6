// The one interface of every display: kms and headless stand behind it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "drivers/device.hpp"
#include "drivers/frame.hpp"

namespace previz {

// Size and rate of a screen. 0 Hz: the screen has no rate of its own (headless), or any will do.
struct DisplayMode {
  int width = 0, height = 0;  // pixels
  double rate_hz = 0;

  friend bool operator==(const DisplayMode&, const DisplayMode&) = default;
};

// "1920x1080@50" or "1920x1080", as a set file writes it; nothing of any other text.
std::optional<DisplayMode> parse_display_mode(std::string_view text);
std::string to_string(const DisplayMode& mode);

enum class DisplayScale {
  letterbox,  // as large as fits, black around it
  one_to_one  // a pixel is a pixel, centred; what does not fit is cut off
};

// What a set asks of a display. Plain data.
struct DisplaySettings {
  std::string connector;            // its stable name; empty: the first that has a screen
  std::optional<DisplayMode> mode;  // absent: what the screen prefers; 0 Hz: the highest rate
  DisplayScale scale = DisplayScale::letterbox;
};

// A display that is there now.
struct FoundDisplay {
  std::string connector;    // its stable name
  std::string description;  // what is plugged in, and its modes
};

// A small picture that is laid over the shown one, at its own size. Premultiplied alpha.
struct Overlay {
  int x = 0, y = 0;           // of its upper left corner, in pixels of the screen
  int width = 0, height = 0;  // pixels
  std::vector<std::uint8_t> rgba;
};

// All that is on the screen at once. The picture may be null: black.
struct Screenful {
  std::shared_ptr<const Plate> picture;
  std::vector<Overlay> overlays;  // later ones above earlier ones
};

// The screenful is on the screen since then (CLOCK_MONOTONIC): of a screen that scans out, since
// the vertical blank before its first line.
struct Shown {
  std::int64_t timestamp_ns = 0;
};

using DisplayEvent = std::variant<Shown, DeviceTrouble>;

// An open display; making it opens the device and sets its mode, destroying it gives the screen
// back as it was. All calls come from the thread that opened it.
class Display {
 public:
  virtual ~Display() = default;

  // The stable name a set file uses for this display.
  virtual std::string name() const = 0;
  // What the screen runs at until it is closed.
  virtual DisplayMode mode() const = 0;

  // Draws, and returns once it can be seen: a screen with a rate paces its caller. After trouble
  // that says `lost` the display is of no use until it is closed and opened again; after other
  // trouble this screenful was not shown, and the next one may be. Throws previz::Error where the
  // graphics card refuses: it is then lost as well.
  virtual DisplayEvent show(const Screenful& screenful) = 0;
  // The screen goes dark, and whoever wants it may have it until the next show(), which takes it
  // back.
  virtual void release() = 0;

  // What was drawn last, as 8-bit RGB of the screen's size.
  virtual Plate read_back() = 0;
};

}  // namespace previz
