#include "daemon/pipeline/track_stage.hpp"

#include <algorithm>
#include <utility>

#include "daemon/pipeline/edits.hpp"
#include "daemon/tracking/apriltag_tracker.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {

TrackStage::TrackStage(const set::Set& set, const ObserverCalibration& calibration,
                       const std::vector<session::TrackRecord>& recorded, std::int64_t start_ns,
                       std::int64_t lap_ns)
    : set_(set),
      start_ns_(start_ns),
      first_ns_(recorded.empty() ? 0 : recorded.front().timestamp_ns),
      lap_ns_(lap_ns) {
  if (set.tracking.enabled)
    tracker_ =
        tracking::make_apriltag_tracker(set.tracking, calibration.intrinsics, calibration.response);
  else if (recorded.empty())
    throw Error(set.file.string() +
                ": tracking.enabled: is false, but the session recorded no poses (track.jsonl)");
  if (set.lighting.from == set::LightFrom::recording &&
      std::ranges::none_of(recorded,
                           [](const auto& record) { return record.captured_light.has_value(); }))
    throw Error(set.file.string() +
                ": lighting.from: is \"recording\", but the session recorded no light "
                "(track.jsonl)");
  Records records;
  for (const session::TrackRecord& record : recorded) {
    records[record.timestamp_ns] = record;
    for (const auto& [name, carrier] : record.carriers) recorded_carriers_.insert(name);
  }
  by_timestamp_ = std::make_shared<const Records>(std::move(records));
}

bool TrackStage::remembers() const {
  return tracker_ && std::ranges::any_of(set_.tracking.carriers, [this](const auto& carrier) {
           return !recorded_carriers_.contains(carrier.name);
         });
}

// When the frame was recorded, whatever lap of its take this is.
std::int64_t TrackStage::recorded_ns(const Shot& shot) const {
  const std::int64_t now_ns = shot.frame->timestamp_ns;
  if (lap_ns_ <= 0 || now_ns <= first_ns_) return now_ns;
  return first_ns_ + (now_ns - first_ns_) % lap_ns_;
}

// That of the frame, or of the last one before it.
const session::TrackRecord* TrackStage::newest_record(const Shot& shot) const {
  const auto after = by_timestamp_->upper_bound(recorded_ns(shot));
  return after == by_timestamp_->begin() ? nullptr : &std::prev(after)->second;
}

void TrackStage::operator()(Shot& shot) {
  const session::TrackRecord* record = newest_record(shot);
  track_camera(shot, record);
  follow_carriers(shot);
  if (record)
    for (const auto& [name, carrier] : record->carriers) carriers_[name] = carrier;
  place(shot, record);
  shot.tracking_done = true;
  if (record && record->captured_light && record->timestamp_ns == recorded_ns(shot))
    shot.recorded_light = {by_timestamp_, &*record->captured_light};
}

void TrackStage::follow_carriers(const Shot& shot) {
  for (auto& [name, carrier] : carriers_) carrier.tags.clear();
  for (const tracking::CarrierTrack& track : shot.track.carriers) {
    if (recorded_carriers_.contains(track.name)) continue;
    if (track.pose)
      carriers_[track.name] = {track.pose->world_from_carrier, track.pose->covariance,
                               track.pose->tags};
    else
      troubles_.push_back("carrier \"" + track.name + "\" is not found" +
                          (track.reason.empty() ? "" : " (" + track.reason + ")") +
                          (carriers_.contains(track.name) ? "; it stays where it was"
                                                          : "; what it carries is not shown"));
  }
}

void TrackStage::track_camera(Shot& shot, const session::TrackRecord* record) {
  if (tracker_) {
    if (shot.index != next_index_) tracker_->reset();
    next_index_ = shot.index + 1;
    shot.track = tracker_->track(*shot.frame);
    return;
  }
  shot.track = {};
  if (!record || record->timestamp_ns != recorded_ns(shot)) {
    shot.track.reason = "track.jsonl has no line for this frame";
  } else if (!record->tracked) {
    shot.track.reason = "lost when it was recorded (track.jsonl)";
  } else {
    shot.track.status = tracking::TrackStatus::tracked;
    shot.track.pose = {record->world_from_camera, record->covariance, 0, record->tags};
    shot.track.seen_tags = record->tags;
  }
}

void TrackStage::place(Shot& shot, const session::TrackRecord* record) const {
  shot.motion.carriers = carriers_;
  shot.motion.animation_s =
      record && record->scene.animation_s
          ? *record->scene.animation_s
          : std::max(0.0, 1e-9 * static_cast<double>(shot.frame->timestamp_ns - start_ns_));
  shot.scene = scene_state(set_, {}, shot.motion);
  if (!record) return;
  for (const auto& [name, where] : record->scene.objects) shot.scene.objects[name] = where;
  for (const auto& [name, light] : record->scene.lights) shot.scene.lights[name] = light;
}

}  // namespace previz::pipeline
