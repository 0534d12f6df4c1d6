// The one interface of every display: kms and headless stand behind it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "drivers/card_picture.hpp"
#include "drivers/device.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz {

// Size and rate of a screen. 0 Hz: the screen has no rate of its own (headless), or any will do.
struct DisplayMode {
  int width = 0, height = 0;  // pixels
  double rate_hz = 0;

  friend bool operator==(const DisplayMode&, const DisplayMode&) = default;
};

// Parses "1920x1080@50" or "1920x1080", as a set file writes it; returns nothing for any other
// text.
std::optional<DisplayMode> parse_display_mode(std::string_view text);
std::string to_string(const DisplayMode& mode);

enum class DisplayScale {
  letterbox,  // as large as fits, black around it
  one_to_one  // not scaled, centred; what does not fit is cut off
};

// The settings that a set asks of a display, as plain data.
struct DisplaySettings {
  std::string connector;            // stable name; empty: the first connector that has a screen
  std::optional<DisplayMode> mode;  // absent: the screen's preferred mode; 0 Hz: the highest rate
  DisplayScale scale = DisplayScale::letterbox;
};

// A display that is there now.
struct FoundDisplay {
  std::string connector;    // its stable name
  std::string description;  // what is plugged in, and its modes
};

// A small picture that is laid over the shown one, at its own size. Premultiplied alpha.
struct Overlay {
  int x = 0, y = 0;           // upper left corner, in pixels of the screen
  int width = 0, height = 0;  // pixels
  std::vector<std::uint8_t> rgba;
};

// Everything that is on the screen at once. A null picture is black, unless there is one on a card.
struct Screenful {
  std::shared_ptr<const Plate> picture;
  std::vector<Overlay> overlays;  // later ones above earlier ones
  CardPicturePtr on_card = {};    // in place of `picture`
};

// The time from which the screenful is on the screen (CLOCK_MONOTONIC); if the screen scans out,
// this is the vertical blank before its first line.
struct Shown {
  std::int64_t timestamp_ns = 0;
};

using DisplayEvent = std::variant<Shown, DeviceTrouble>;

// An open display. Making it opens the device and sets its mode; destroying it gives the screen
// back as it was. All calls must come from the thread that opened it.
class Display {
 public:
  virtual ~Display() = default;

  // The stable name a set file uses for this display.
  virtual std::string name() const = 0;
  // Returns the mode that the screen runs in until it is closed.
  virtual DisplayMode mode() const = 0;

  // Draws a screenful and returns once it can be seen, so that a screen with a rate paces its
  // caller. After trouble with `lost` the display is of no use until it is closed and opened again;
  // after other trouble this screenful was not shown, but the next one may be. Throws previz::Error
  // if the graphics card refuses; the display is then lost as well.
  virtual DisplayEvent show(const Screenful& screenful) = 0;
  // Returns the card whose pictures (Screenful::on_card) can be shown; nothing where there is none.
  // One that is refused is reported as other trouble by show(), which then shows `picture` and the
  // overlays; if the driver refuses one of its own card, there is no such card from then on.
  virtual std::optional<CardIdentity> card() const { return std::nullopt; }
  // Makes the screen dark and leaves it to other programs until the next show(), which takes it
  // back.
  virtual void release() = 0;

  // Returns what was drawn last, as 8-bit RGB of the screen's size.
  virtual Plate read_back() = 0;
};

}  // namespace previz
