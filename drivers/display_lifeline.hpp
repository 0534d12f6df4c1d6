// Keeps a display alive: opens it when a screen is there, and opens it again when it is lost.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "drivers/backoff.hpp"
#include "drivers/display.hpp"

namespace previz {

using DisplayOpener = std::function<std::unique_ptr<Display>()>;
// Returns what to show on a screen of the given mode.
using Composer = std::function<Screenful(const DisplayMode&)>;

// All calls must come from one thread. Every opening settles the mode anew.
class DisplayLifeline {
 public:
  // `name` stands in reports of trouble. Opens nothing yet.
  DisplayLifeline(std::string name, DisplayOpener open, const BackoffLimits& backoff = {},
                  HostClock clock = {});

  // Opens the display if an attempt is due, and shows what `compose` returns for it. Trouble is
  // reported once for each change to the worse, and never with `lost`. Returns nothing if nothing
  // was shown and the reason was reported before.
  std::optional<DisplayEvent> show(const Composer& compose);
  void release();
  // Closes the display. Whoever ends the thread of the other calls must call this on that thread,
  // because a graphics context belongs to its thread.
  void close();

  DeviceState state() const { return state_; }  // absent, starting, streaming, lost
  // Returns the display for mode() and read_back(); null while there is none.
  Display* display() { return display_.get(); }

 private:
  std::optional<DisplayEvent> open();
  std::optional<DisplayEvent> trouble(const std::string& what);

  const std::string name_;
  const DisplayOpener open_;
  const HostClock clock_;
  Backoff backoff_;
  DeviceState state_ = DeviceState::absent;
  std::string told_;  // trouble last reported; empty while all is well
  std::unique_ptr<Display> display_;
};

}  // namespace previz
