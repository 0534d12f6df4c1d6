#include "daemon/rig/service.hpp"

#include <systemd/sd-daemon.h>

#include <algorithm>

namespace previz::rig {

Progress progress_of(const pipeline::MetricsSnapshot& metrics, const State& state) {
  const auto frames_of = [&](const char* stage) {
    const auto found = metrics.stages.find(stage);
    return found == metrics.stages.end() ? 0 : found->second.frames;
  };
  return {frames_of("observer"), frames_of("display"), frames_of("light camera"),
          frames_of("lighting"), state.camera_lost,    state.mode == Mode::standby};
}

bool advances(const Progress& before, const Progress& now) {
  const bool captures = now.camera_lost || now.captured > before.captured;
  const bool shows = now.camera_lost || now.dark || now.shown > before.shown;
  const bool lights = now.lights == before.lights || now.light_estimates > before.light_estimates;
  return captures && shows && lights;
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
  return std::chrono::milliseconds(std::max<std::uint64_t>(microseconds / 2000, 1));
}

}  // namespace service
}  // namespace previz::rig
