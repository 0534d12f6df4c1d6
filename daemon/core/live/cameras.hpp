// Opens the cameras and buttons that a set file names.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "daemon/core/live/driven_camera.hpp"
#include "daemon/core/session/replay_camera.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/buttons.hpp"
#include "drivers/camera.hpp"

namespace previz::live {

// The started cameras of a set. Replayed streams of one session keep their common time. A real
// camera may still be missing and is picked up when it comes.
struct Cameras {
  std::unique_ptr<Camera> observer;
  std::unique_ptr<Camera> light;    // null: the set has none, or an environment file
  std::size_t light_exposures = 1;  // number of different exposures in a bracket
  session::Session recorded;        // the replayed observer's: calibration and track
  ReplayOptions::Origin origin;     // the replayed observer's
  std::int64_t lap_ns = 0;          // length of a lap if the observer is looped, else 0
  // The cameras' clock, which every timestamp_ns is on, minus CLOCK_MONOTONIC.
  std::int64_t clock_offset_ns = 0;
};

// Opens and starts the set's cameras. With `loop`, replayed streams start again at their end. `usb`
// announces devices that are plugged in. Throws previz::Error naming the key whose driver this
// build does not have, or the session that cannot be read.
Cameras open_cameras(const set::Set& set, bool loop = false, const Usb& usb = nullptr);

// Opens the buttons of a replayed observer's session, which are pressed again as its frames come.
// Returns none if the set maps no button.
std::vector<std::unique_ptr<Buttons>> open_buttons(const set::Set& set, const Cameras& cameras);

}  // namespace previz::live
