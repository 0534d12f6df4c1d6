// Tracking as a stage: the pose of each observer frame, from the tags or from the session's track.
#pragma once

#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "daemon/pipeline/shot.hpp"
#include "daemon/set/set.hpp"
#include "daemon/tracking/recorded_track.hpp"
#include "daemon/tracking/tracker.hpp"
#include "drivers/calibration.hpp"
#include "drivers/session/session.hpp"

namespace previz::pipeline {

class TrackStage {
 public:
  // `recorded` is used where the set says tracking.enabled = false or lighting.from =
  // "recording"; throws previz::Error if it holds no poses or no light then. Animations begin at
  // `start_ns`, that of the take. `lap_ns`: of frames that are replayed in a loop (replay_lap_ns),
  // otherwise 0.
  TrackStage(const set::Set& set, const ObserverCalibration& calibration,
             const std::vector<session::TrackRecord>& recorded, std::int64_t start_ns,
             std::int64_t lap_ns = 0);

  // Fills shot.track, shot.motion and shot.scene, and shot.recorded_light from what was recorded. A
  // frame that was not tracked is lost, never guessed; a carrier that is not found stays where it
  // was. What was recorded of carriers and scene comes back as it was recorded, in frames without a
  // line as in the last one that has one. Frames come in order; where some are left out, the
  // tracker forgets the last pose.
  void operator()(Shot& shot);

  // True where a frame depends on those before it: who wants one in the middle of a take has to go
  // through them.
  bool remembers() const;

  // What is not found where it should be, since the last call, in plain words.
  std::vector<std::string> troubles() { return std::exchange(troubles_, {}); }

 private:
  void track_camera(Shot& shot);
  void follow_carriers(const Shot& shot);
  void place(Shot& shot, const session::TrackRecord* record) const;

  const set::Set set_;
  const std::shared_ptr<const tracking::RecordedTrack> recorded_;
  const std::unique_ptr<tracking::Tracker> tracker_;
  std::uint64_t next_index_ = 0;
  std::set<std::string> recorded_carriers_;  // their names
  std::int64_t start_ns_ = 0;
  session::Carriers carriers_;
  std::vector<std::string> troubles_;
};

}  // namespace previz::pipeline
