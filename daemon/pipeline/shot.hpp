// One observer frame on its way: what is known of it so far. Owned by one stage at a time.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "daemon/lighting/environment.hpp"
#include "daemon/pipeline/edits.hpp"
#include "daemon/render/gpu_environment.hpp"
#include "daemon/render/layers.hpp"
#include "daemon/set/set.hpp"
#include "daemon/tracking/tracker.hpp"
#include "drivers/frame.hpp"
#include "drivers/session/session.hpp"

namespace previz::pipeline {

// A finished light estimate and the light frames (by sequence number) it was made from.
struct Light {
  lighting::Lighting lighting;
  std::vector<set::Light> lamps;       // of its sources
  render::EncodedEnvironment encoded;  // as the renderer takes it, so that no frame waits for that
  std::vector<std::uint64_t> sequences;  // empty: an environment given as a file
  session::CapturedLight record;         // as a take carries it
};
using LightPtr = std::shared_ptr<const Light>;

struct Shot {
  // From the observer.
  std::uint64_t index = 0;  // in the stream, from 0
  FramePtr frame;
  PlatePtr plate;  // the frame converted; null until plate_of() was called
  std::chrono::steady_clock::time_point arrived;  // when the daemon got it

  // From tracking and lighting.
  tracking::Track track;
  bool tracking_done = false;  // false: tracking was paused, and the track says nothing
  LightPtr light;              // null: no light frame yet
  std::shared_ptr<const session::CapturedLight> recorded_light;  // null: none came with the frame
  Motion motion;              // what is moved by hand, and by itself
  session::SceneState scene;  // what was moved or relit; empty: as in the set

  // From rendering. `untouched` says why the plate passes through as it is; empty: it was rendered.
  std::string untouched;
  PlatePtr picture;
  std::shared_ptr<const render::Layers> layers;  // null where the pipeline shows pictures only
  render::Counters counters;
  bool whole = false;  // false: interrupted before its last sample
  double render_s = 0;
  double error = 0;     // Refined::error
  int samples = 0;      // of the picture; 0: untouched
  bool frozen = false;  // a round of refining one frame, not a new one
};

// The shot's frame as a plate, converted by the first call.
inline const PlatePtr& plate_of(Shot& shot) {
  if (!shot.plate) shot.plate = std::make_shared<const Plate>(to_plate(*shot.frame));
  return shot.plate;
}

}  // namespace previz::pipeline
