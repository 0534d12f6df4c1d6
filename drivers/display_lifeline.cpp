#include "drivers/display_lifeline.hpp"

#include <utility>

#include "drivers/error.hpp"

namespace previz {

DisplayLifeline::DisplayLifeline(std::string name, DisplayOpener open, const BackoffLimits& backoff,
                                 HostClock clock)
    : name_(std::move(name)), open_(std::move(open)), clock_(std::move(clock)), backoff_(backoff) {}

std::optional<DisplayEvent> DisplayLifeline::show(const Composer& compose) {
  if (!display_) {
    if (!backoff_.due(clock_.now())) return std::nullopt;
    if (std::optional<DisplayEvent> event = open()) return event;
    if (!display_) return std::nullopt;
  }
  DisplayEvent event = [&]() -> DisplayEvent {
    try {
      return display_->show(compose(display_->mode()));
    } catch (const Error& error) {
      return DeviceTrouble{name_, error.what(), true};
    }
  }();
  if (const auto* what = std::get_if<DeviceTrouble>(&event)) {
    if (!what->lost) return trouble(what->what);
    display_.reset();
    state_ = DeviceState::lost;
    backoff_.failed(clock_.now());
    return trouble(what->what + "; reopening it");
  }
  state_ = DeviceState::streaming;
  backoff_.reset();
  told_.clear();
  return event;
}

void DisplayLifeline::release() {
  try {
    if (display_) display_->release();
  } catch (const Error&) {
    display_.reset();  // frees the screen, too; the next show() reopens it
    state_ = DeviceState::lost;
  }
}

void DisplayLifeline::close() {
  display_.reset();
  state_ = DeviceState::absent;
  told_.clear();
}

std::optional<DisplayEvent> DisplayLifeline::open() {
  try {
    display_ = open_();
    state_ = DeviceState::starting;
    return std::nullopt;
  } catch (const Error& error) {
    state_ = DeviceState::absent;
    backoff_.failed(clock_.now());
    return trouble(std::string(error.what()) + "; retrying until it is available");
  }
}

std::optional<DisplayEvent> DisplayLifeline::trouble(const std::string& what) {
  if (what == std::exchange(told_, what)) return std::nullopt;
  return DeviceTrouble{name_, what};
}

}  // namespace previz
