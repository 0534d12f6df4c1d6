// The tracking stage finds the pose of each observer frame, from the tags or from the session's
// track.
#pragma once

#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/session/session.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/core/tracking/apriltag_tracker.hpp"
#include "daemon/core/tracking/recorded_track.hpp"
#include "daemon/core/tracking/tracker.hpp"
#include "drivers/calibration.hpp"

namespace previz::pipeline {

struct Take;

class TrackStage {
 public:
  // `recorded` is used if the set says tracking.enabled = false or lighting.from = "recording";
  // throws previz::Error if it then holds no poses or no light. Animations begin at `start_ns`, the
  // start of the take. `lap_ns` is the length of a lap if frames are replayed in a loop
  // (replay_lap_ns), otherwise 0. `search` is how tags are searched.
  TrackStage(const set::Set& set, const ObserverCalibration& calibration,
             const std::vector<session::TrackRecord>& recorded, std::int64_t start_ns,
             std::int64_t lap_ns = 0, tracking::Search search = tracking::Search::whole);

  // Tracks a take. Tags are left out that other tags say have moved, as judged in frames spread
  // over all of it, so that a picture is the same whichever part of the take is looked at.
  explicit TrackStage(const Take& take);

  // Uses these tags for no pose (tracking::Tracker::leave_out()).
  void leave_out(const std::set<int>& tags) { tracker_->leave_out(tags); }

  // Fills shot.track, shot.motion and shot.scene, and shot.recorded_light from the recorded track.
  // A frame that was not tracked is lost, never guessed; a carrier that is not found stays where it
  // was. Recorded carriers and scene states return as they were recorded; a frame without a line in
  // the track repeats the last line before it. Frames come in order; where some are left out, the
  // tracker forgets the last pose.
  void operator()(Shot& shot);

  // True if a frame depends on the frames before it, so that a frame in the middle of a take cannot
  // be tracked without them.
  bool remembers() const;

  // Returns the carriers that were not found since the last call, in plain words.
  std::vector<std::string> troubles() { return std::exchange(troubles_, {}); }

 private:
  void track_camera(Shot& shot);
  void follow_carriers(const Shot& shot);
  void place(Shot& shot, const session::TrackRecord* record) const;

  const set::Set set_;
  const std::shared_ptr<const tracking::RecordedTrack> recorded_;
  const std::unique_ptr<tracking::Tracker> tracker_;
  std::uint64_t next_index_ = 0;
  std::set<std::string> recorded_carriers_;  // names
  std::int64_t start_ns_ = 0;
  session::Carriers carriers_;
  std::vector<std::string> troubles_;
};

}  // namespace previz::pipeline
