// The work of the rig's tracking thread: where the film camera is and what was moved by hand, the
// light that belongs to the frame, and the frame's line in the take.
#pragma once

#include <memory>
#include <optional>
#include <set>

#include "daemon/core/live/cameras.hpp"
#include "daemon/core/live/live_doubts.hpp"
#include "daemon/core/live/live_light.hpp"
#include "daemon/core/live/look.hpp"
#include "daemon/core/output/recorder.hpp"
#include "daemon/core/pipeline/animation_clock.hpp"
#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/pipeline/edits.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/pipeline/stage_keeper.hpp"
#include "daemon/core/pipeline/track_stage.hpp"
#include "daemon/core/tracking/pose_filter.hpp"
#include "daemon/core/tracking/tag_trust.hpp"

namespace previz::live {

class LiveTracking {
 public:
  struct Parts {  // outlive the tracking
    const set::Set& set;
    const Cameras& cameras;
    output::Recorder& recorder;
    const pipeline::Newest<Look>& look;
    LiveLight& light;
    pipeline::StageKeeper::Parts kept;
  };
  // Throws previz::Error on a set that cannot be tracked.
  LiveTracking(Parts parts, const ObserverCalibration& calibration);

  // Returns the shot tracked and lit, and offers its line to the recorder. What fails is reported
  // and restarts by itself; the shot is then without a pose, or has the light as it was.
  pipeline::Shot track(pipeline::Shot shot);

 private:
  void make_stage();
  void report_carriers(const pipeline::Shot& shot);
  // Leaves out the tags that have moved, from the next frame on, until they are back.
  void judge_tags(const pipeline::Shot& shot);
  void offer_line(pipeline::Shot& shot, const pipeline::Edits& edits);

  const Parts parts_;
  const ObserverCalibration calibration_;
  std::optional<pipeline::TrackStage> stage_;
  std::optional<tracking::TagTrust> trust_;
  std::set<int> moved_;                         // tags that are left out
  std::optional<tracking::PoseFilter> filter_;  // absent: the set shows poses as they are found
  pipeline::AnimationClock animation_clock_;
  pipeline::StageKeeper tracking_, lighting_;
  LiveDoubts doubts_;
};

}  // namespace previz::live
