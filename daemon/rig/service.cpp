#include "daemon/rig/service.hpp"

#include <systemd/sd-daemon.h>

#include <algorithm>

namespace previz::rig {

Progress progress_of(const pipeline::MetricsSnapshot& metrics, const State& state,
                     bool has_screen) {
  const auto frames_of = [&](const char* stage) {
    const auto found = metrics.stages.find(stage);
    return found == metrics.stages.end() ? 0 : found->second.frames;
  };
  const auto count_of = [&](const char* event) {
    const auto found = metrics.counts.find(event);
    return found == metrics.counts.end() ? 0 : found->second;
  };
  // A picture that was dropped because there was no display does not mean that the screen hangs.
  std::uint64_t screened = frames_of("screen");
  if (const auto screen = metrics.stages.find("screen"); screen != metrics.stages.end())
    for (const auto& [cause, dropped] : screen->second.dropped) screened += dropped;
  const bool no_device = count_of("device lost") > count_of("device opened again");
  return {.captured = frames_of("observer"),
          .shown = frames_of("display"),
          .screened = screened,
          .lights = frames_of("light camera"),
          .light_estimates = frames_of("lighting"),
          .has_screen = has_screen,
          .camera_lost = state.camera_lost,
          .dark = state.mode == Mode::standby || no_device};
}

bool advances(const Progress& before, const Progress& now) {
  const bool captures = now.camera_lost || now.captured > before.captured;
  const bool idle = now.camera_lost || now.dark;
  const bool shows = idle || now.shown > before.shown;
  const bool screens = idle || !now.has_screen || now.screened > before.screened;
  const bool lights = now.lights == before.lights || now.light_estimates > before.light_estimates;
  return captures && shows && screens && lights;
}

namespace service {

void ready(const std::string& status) {
  sd_notify(0, ("READY=1\nSTATUS=" + status).c_str());
}

void status(const std::string& status) {
  sd_notify(0, ("STATUS=" + status).c_str());
}

void stopping() {
  sd_notify(0, "STOPPING=1");
}

void feed_watchdog() {
  sd_notify(0, "WATCHDOG=1");
}

std::optional<std::chrono::milliseconds> watchdog_interval() {
  std::uint64_t microseconds = 0;
  if (sd_watchdog_enabled(0, &microseconds) <= 0) return std::nullopt;
  return std::chrono::milliseconds(std::max<std::uint64_t>(microseconds / 4000, 1));
}

}  // namespace service
}  // namespace previz::rig
