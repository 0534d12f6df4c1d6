// Tracking as a stage: the pose of each observer frame, from the tags or from the session's track.
#pragma once

#include <memory>
#include <unordered_map>
#include <vector>

#include "daemon/pipeline/shot.hpp"
#include "daemon/set/set.hpp"
#include "daemon/tracking/tracker.hpp"
#include "drivers/calibration.hpp"
#include "drivers/session/session.hpp"

namespace previz::pipeline {

class TrackStage {
 public:
  // `recorded` is used where the set says tracking.enabled = false; throws previz::Error if it is
  // empty then. `lap_ns`: of frames that are replayed in a loop (replay_lap_ns), otherwise 0.
  TrackStage(const set::Set& set, const ObserverCalibration& calibration,
             const std::vector<session::TrackRecord>& recorded, std::int64_t lap_ns = 0);

  // Fills shot.track, and shot.scene from what was recorded. A frame that was not tracked is lost,
  // never guessed. Frames come in order; where some are left out, the tracker forgets the last
  // pose.
  void operator()(Shot& shot);

 private:
  const session::TrackRecord* recorded_at(std::int64_t timestamp_ns) const;

  std::unique_ptr<tracking::Tracker> tracker_;  // null: recorded poses
  std::uint64_t next_index_ = 0;
  std::unordered_map<std::int64_t, session::TrackRecord> by_timestamp_;  // as recorded
  std::int64_t first_ns_ = 0, lap_ns_ = 0;
};

}  // namespace previz::pipeline
