// Reports to systemd: that the rig is ready, that it stops, and that frames advance.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "daemon/pipeline/metrics.hpp"
#include "daemon/rig/mode.hpp"

namespace previz::rig {

// How far the pipeline has come.
struct Progress {
  std::uint64_t captured = 0, shown = 0;          // observer frames; pictures
  std::uint64_t screened = 0;                     // pictures the screen showed or failed to show
  std::uint64_t lights = 0, light_estimates = 0;  // light frames; estimates from them
  bool has_screen = false;
  bool camera_lost = false, dark = false;  // dark: standby, or the GPU is lost
};
Progress progress_of(const pipeline::MetricsSnapshot& metrics, const State& state, bool has_screen);

// Returns true if every part with work to do has progressed: cameras that are there deliver frames,
// the frames are shown (but not in standby), on the screen too if there is one, and light frames
// become estimates. A rig that waits for its camera or opens its GPU again counts as well.
bool advances(const Progress& before, const Progress& now);

// Talks to systemd's notification socket; outside systemd every call does nothing. See
// sd_notify(3), sd_watchdog_enabled(3).
namespace service {
void ready(const std::string& status);
void status(const std::string& status);
void stopping();
void feed_watchdog();
// Returns a quarter of WatchdogSec=: sd_watchdog_enabled recommends a half, but frames that are
// late by one interval should not yet end the service. Returns nothing if there is no watchdog.
std::optional<std::chrono::milliseconds> watchdog_interval();
}  // namespace service

}  // namespace previz::rig
