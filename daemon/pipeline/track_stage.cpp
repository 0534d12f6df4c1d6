#include "daemon/pipeline/track_stage.hpp"

#include "daemon/tracking/apriltag_tracker.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {

TrackStage::TrackStage(const set::Set& set, const ObserverCalibration& calibration,
                       const std::vector<session::TrackRecord>& recorded, std::int64_t lap_ns)
    : first_ns_(recorded.empty() ? 0 : recorded.front().timestamp_ns), lap_ns_(lap_ns) {
  if (set.tracking.enabled)
    tracker_ =
        tracking::make_apriltag_tracker(set.tracking, calibration.intrinsics, calibration.response);
  else if (recorded.empty())
    throw Error(set.file.string() +
                ": tracking.enabled: is false, but the session recorded no poses (track.jsonl)");
  for (const session::TrackRecord& record : recorded) by_timestamp_[record.timestamp_ns] = record;
}

const session::TrackRecord* TrackStage::recorded_at(std::int64_t timestamp_ns) const {
  if (lap_ns_ > 0 && timestamp_ns > first_ns_)
    timestamp_ns = first_ns_ + (timestamp_ns - first_ns_) % lap_ns_;
  const auto found = by_timestamp_.find(timestamp_ns);
  return found == by_timestamp_.end() ? nullptr : &found->second;
}

void TrackStage::operator()(Shot& shot) {
  shot.tracking_done = true;
  const session::TrackRecord* record = recorded_at(shot.frame->timestamp_ns);
  if (record) shot.scene = record->scene;
  if (tracker_) {
    if (shot.index != next_index_) tracker_->reset();
    next_index_ = shot.index + 1;
    shot.track = tracker_->track(*shot.frame);
    return;
  }
  shot.track = {};
  if (!record) {
    shot.track.reason = "track.jsonl has no line for this frame";
  } else if (!record->tracked) {
    shot.track.reason = "lost when it was recorded (track.jsonl)";
  } else {
    shot.track.status = tracking::TrackStatus::tracked;
    shot.track.pose = {record->world_from_camera, record->covariance, 0, record->tags};
    shot.track.seen_tags = record->tags;
  }
}

}  // namespace previz::pipeline
