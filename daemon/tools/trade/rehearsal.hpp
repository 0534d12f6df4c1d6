// Runs the live pipeline on the take for a few seconds, to see what rate settings hold beside all
// that runs beside them: cameras, tracking and lighting, which a processor that draws shares.
#pragma once

#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>

#include "daemon/core/render/renderer.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/core/timing/path_timer.hpp"

namespace previz::trade {

struct Rehearsal {
  double fps = 0;            // pictures a second, once the rate had settled; 0: too few were shown
  double frame_s = 0;        // time that the render stage worked on each of those
  timing::Making making;     // of the last picture: what the governor had come to
  std::string why_not = {};  // fps is 0 because a stage failed so
};

// Plays `take` in the place of the set's cameras, over and over in its own time, and shows the
// pictures nowhere; nothing is recorded. Takes about `seconds` from the first picture on, a third
// of which the governor has to settle in. The set has its samples, steps and rate (quality.fps).
// Throws previz::Error for what keeps `previzd run` from running.
Rehearsal rehearse(const std::shared_ptr<render::Device>& device, const set::Set& set,
                   const scene::Scene& scene, const std::filesystem::path& take, double seconds,
                   const std::stop_token& stop);

}  // namespace previz::trade
