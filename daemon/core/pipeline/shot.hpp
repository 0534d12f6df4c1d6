// One observer frame on its way through the stages, with everything known about it so far. One
// stage owns it at a time.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/pipeline/edits.hpp"
#include "daemon/core/pipeline/light.hpp"
#include "daemon/core/render/picture/layers.hpp"
#include "daemon/core/render/picture/sample_sums.hpp"
#include "daemon/core/render/world/gpu_environment.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/pose_filter.hpp"
#include "daemon/core/tracking/tracker.hpp"
#include "drivers/card_picture.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::pipeline {

struct Shot {
  // The observer camera fills these in.
  std::uint64_t index = 0;  // place in the stream, from 0
  FramePtr frame;           // in colour, if the camera's is a mosaic and that was made of it
  FramePtr camera;          // as the camera gave it, if that is another one; null: it is `frame`
  PlatePtr plate;           // converted frame; null until plate_of() was called
  std::chrono::steady_clock::time_point arrived;  // when the daemon got it

  // Tracking and lighting fill these in.
  tracking::Track track;
  bool tracking_done = false;  // false: tracking was paused, and `track` is not valid
  // Where a live picture shows the camera; absent: where `track` says. It is for the display alone:
  // a take, a refinement and offline work use `track`.
  std::optional<tracking::ShownPose> shown_pose;
  LightPtr light;                                                // null: no light frame yet
  std::shared_ptr<const session::CapturedLight> recorded_light;  // null: none came with the frame
  Motion motion;              // things moved by hand, and by themselves
  session::SceneState scene;  // things moved or relit; empty: as in the set

  // Rendering fills these in. `untouched` says why the plate passes through as it is; empty: it was
  // rendered.
  std::string untouched;
  PlatePtr picture;
  CardPicturePtr
      on_card;  // the picture in a card's memory, also in place of `picture`; may be null
  std::shared_ptr<const render::Layers> layers;  // null: the pipeline only shows pictures
  render::Counters counters;
  bool whole = false;  // false: interrupted before its last sample
  double render_s = 0;
  double error = 0;  // Refined::error
  int samples = 0;   // samples of the picture; 0: untouched
  int history = 0;   // earlier frames whose samples the picture shares; 0: it is of its own alone
  // True: a frame of a take that is rendered only because others are averaged with it.
  bool only_neighbour = false;
  bool frozen = false;  // true: a round of refining one frame, not a new frame
  // In place of picture and layers, where only a range of the samples is rendered; else null.
  std::shared_ptr<const render::SampleSums> sums;
};

// Returns where the picture shows the camera; null: nowhere.
inline const glm::dmat4* world_from_camera(const Shot& shot) {
  if (shot.shown_pose) return &shot.shown_pose->world_from_camera;
  return shot.track.pose ? &shot.track.pose->world_from_camera : nullptr;
}

// Returns the frame that the renderer makes the plate of: as few bytes as there are.
inline const FramePtr& camera_frame(const Shot& shot) {
  return shot.camera ? shot.camera : shot.frame;
}

// Returns the shot's frame as a plate, which the first call converts.
inline const PlatePtr& plate_of(Shot& shot) {
  if (!shot.plate) shot.plate = std::make_shared<const Plate>(to_plate(*shot.frame));
  return shot.plate;
}

}  // namespace previz::pipeline
