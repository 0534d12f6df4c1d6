// The one registry of drivers: from what a set file names to open cameras and buttons.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "daemon/rig/driven_camera.hpp"
#include "daemon/set/set.hpp"
#include "drivers/buttons.hpp"
#include "drivers/camera.hpp"
#include "drivers/replay/replay_camera.hpp"
#include "drivers/session/session.hpp"

namespace previz::rig {

// The rig's cameras as the set names them, started. Replayed streams of one session keep their
// common time; a real camera need not be there yet, and is picked up when it is.
struct Cameras {
  std::unique_ptr<Camera> observer;
  std::unique_ptr<Camera> light;    // null: the set has none, or gives an environment file
  std::size_t light_exposures = 1;  // different ones that the light camera takes in turn
  session::Session recorded;        // of the replayed observer: calibration and track
  ReplayOptions::Origin origin;     // of the replayed observer
  std::int64_t lap_ns = 0;          // of the observer, where it is replayed in a loop
  // The cameras' clock, that of every timestamp_ns, less CLOCK_MONOTONIC.
  std::int64_t clock_offset_ns = 0;
};

// `usb` wakes those who wait for a camera.
// `loop`: replayed streams start again at their end. Throws previz::Error naming the key whose
// driver this build has not, or the session that cannot be read.
Cameras open_cameras(const set::Set& set, bool loop = false, const Usb& usb = nullptr);

// The rig's buttons. With a replayed observer they are those of its session, pressed again when its
// frames come; none where the set maps no button.
std::vector<std::unique_ptr<Buttons>> open_buttons(const set::Set& set, const Cameras& cameras);

}  // namespace previz::rig
