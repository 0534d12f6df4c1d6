// A display that is never given up: opened when a screen is there, opened again when it is lost.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "drivers/backoff.hpp"
#include "drivers/display.hpp"

namespace previz {

using DisplayOpener = std::function<std::unique_ptr<Display>()>;
// What to show on a screen of this mode.
using Composer = std::function<Screenful(const DisplayMode&)>;

// All calls come from one thread. Each time it is opened the mode is agreed anew.
class DisplayLifeline {
 public:
  // `name` is what trouble is told under. Opens nothing yet.
  DisplayLifeline(std::string name, DisplayOpener open, const BackoffLimits& backoff = {},
                  HostClock clock = {});

  // Opens the display where that is due, and shows what is composed for it. Trouble is told once
  // for each change to the worse, and never says `lost`; nothing is returned where nothing was
  // shown and that was told before.
  std::optional<DisplayEvent> show(const Composer& compose);
  void release();
  // Gives the display up. Whoever ends the thread that the calls came from calls it there: a
  // graphics context stays that thread's.
  void close();

  DeviceState state() const { return state_; }  // absent, starting, streaming, lost
  // Null while there is none; for mode() and read_back().
  Display* display() { return display_.get(); }

 private:
  std::optional<DisplayEvent> open();
  std::optional<DisplayEvent> trouble(const std::string& what);

  const std::string name_;
  const DisplayOpener open_;
  const HostClock clock_;
  Backoff backoff_;
  DeviceState state_ = DeviceState::absent;
  std::string told_;  // the trouble it is in, as last told
  std::unique_ptr<Display> display_;
};

}  // namespace previz
