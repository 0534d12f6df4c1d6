// The one registry of camera drivers: from what a set file names to an open camera.
#pragma once

#include <memory>

#include "daemon/set/set.hpp"
#include "drivers/camera.hpp"
#include "drivers/session/session.hpp"

namespace previz::rig {

// The rig's cameras as the set names them, started. Replayed streams of one session keep their
// common time; a real camera need not be there yet, and is picked up when it is.
struct Cameras {
  std::unique_ptr<Camera> observer;
  std::unique_ptr<Camera> light;  // null: the set has none, or gives an environment file
  session::Session recorded;      // of the replayed observer: calibration and track
};

// `loop`: replayed streams start again at their end. Throws previz::Error naming the key whose
// driver this build has not, or the session that cannot be read.
Cameras open_cameras(const set::Set& set, bool loop = false);

}  // namespace previz::rig
