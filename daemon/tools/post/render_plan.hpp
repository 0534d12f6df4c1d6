// Opens what a render needs and says what it will do, before anything is rendered.
#pragma once

#include <optional>
#include <string>

#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/session/timecode.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/tools/post/render_options.hpp"

namespace previz::post {

struct RenderPlan {
  pipeline::Take take;  // its set has what the options override, and the folder of the pictures
  std::optional<set::Overlay> with;
  FrameRange range;          // of the frames that are asked for, within the take
  std::string settings;      // the text of render.json: everything that decides the pictures
  session::TakeClock clock;  // of the film camera
};

// Throws previz::Error on anything that is wrong with the take, the set or the options.
RenderPlan plan_render(const RenderOptions& options);

// Returns how many frames on each side a picture is averaged with.
int neighbours_of(const set::Quality& quality);

}  // namespace previz::post
