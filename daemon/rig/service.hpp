// What systemd is told of the rig: ready, reloading, stopping, and that frames advance.
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
  std::uint64_t lights = 0, light_estimates = 0;  // light frames; what lighting made of them
  bool camera_lost = false, dark = false;         // dark: standby
};
Progress progress_of(const pipeline::MetricsSnapshot& metrics, const State& state);

// Whether everything that has something to do has done something: cameras that are there deliver,
// what they deliver is shown (but not in standby) and lights the scene. A rig without a camera
// waits for it, and is well.
bool advances(const Progress& before, const Progress& now);

// The other end of systemd's notification socket; outside systemd every call does nothing.
// sd_notify(3), sd_watchdog_enabled(3).
namespace service {
void ready(const std::string& status);
void status(const std::string& status);
void stopping();
void feed_watchdog();
// Half of WatchdogSec=, as sd_watchdog_enabled recommends; none: no watchdog waits for food.
std::optional<std::chrono::milliseconds> watchdog_interval();
}  // namespace service

}  // namespace previz::rig
