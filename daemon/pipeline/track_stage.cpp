#include "daemon/pipeline/track_stage.hpp"

#include "daemon/tracking/apriltag_tracker.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {

TrackStage::TrackStage(const set::Set& set, const ObserverCalibration& calibration,
                       const std::vector<session::TrackRecord>& recorded) {
  if (set.tracking.enabled)
    tracker_ =
        tracking::make_apriltag_tracker(set.tracking, calibration.intrinsics, calibration.response);
  else if (recorded.empty())
    throw Error(set.file.string() +
                ": tracking.enabled: is false, but the session recorded no poses (track.jsonl)");
  for (const session::TrackRecord& record : recorded) by_timestamp_[record.timestamp_ns] = record;
}

void TrackStage::operator()(Shot& shot) {
  const auto found = by_timestamp_.find(shot.frame->timestamp_ns);
  if (found != by_timestamp_.end()) shot.scene = found->second.scene;
  if (tracker_) {
    if (shot.index != next_index_) tracker_->reset();
    next_index_ = shot.index + 1;
    shot.track = tracker_->track(*shot.frame);
    return;
  }
  shot.track = {};
  if (found == by_timestamp_.end()) {
    shot.track.reason = "track.jsonl has no line for this frame";
  } else if (!found->second.tracked) {
    shot.track.reason = "lost when it was recorded (track.jsonl)";
  } else {
    const session::TrackRecord& record = found->second;
    shot.track.status = tracking::TrackStatus::tracked;
    shot.track.pose = {record.world_from_camera, record.covariance, 0, record.tags};
    shot.track.seen_tags = record.tags;
  }
}

}  // namespace previz::pipeline
