#include "daemon/core/pipeline/track_stage.hpp"

#include <algorithm>
#include <utility>

#include "daemon/core/pipeline/edits.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/tracking/tag_trust.hpp"
#include "daemon/core/tracking/trackers.hpp"
#include "drivers/error.hpp"

namespace previz::pipeline {
namespace {

constexpr std::size_t frames_asked = 12, frames_decisive = 2;

std::set<int> moved_tags(const Take& take) {
  const set::Tracking& tracking = take.set.tracking;
  if (!tracking.enabled || tracking.tags.size() < 3) return {};
  const auto tracker =
      tracking::make_apriltag_tracker(tracking, take.observer.intrinsics, take.observer.response);
  tracking::TagTrust trust(tracking, take.observer.intrinsics);
  const std::size_t frames = take.observer_stream->records().size();
  const std::size_t parts = std::min(frames_asked, frames);
  for (std::size_t i = 0; i < parts; ++i) {
    tracker->reset();
    try {
      trust.add(tracker->track(*take.observer_stream->read((2 * i + 1) * frames / (2 * parts))));
    } catch (const Error&) {
      continue;  // whoever needs that frame names it
    }
  }
  return trust.moved(frames_decisive);
}

}  // namespace

TrackStage::TrackStage(const Take& take)
    : TrackStage(take.set, take.observer, take.session.track, start_of(take)) {
  leave_out(moved_tags(take));
}

TrackStage::TrackStage(const set::Set& set, const ObserverCalibration& calibration,
                       const std::vector<session::TrackRecord>& recorded, std::int64_t start_ns,
                       std::int64_t lap_ns, tracking::Search search)
    : set_(set),
      recorded_(std::make_shared<tracking::RecordedTrack>(recorded, lap_ns)),
      tracker_(tracking::make_tracker(set, calibration, recorded_, search)),
      start_ns_(start_ns) {
  if (set.lighting.from == set::LightFrom::recording &&
      std::ranges::none_of(recorded,
                           [](const auto& record) { return record.captured_light.has_value(); }))
    throw Error(set.file.string() +
                ": lighting.from: is \"recording\", but the session recorded no light "
                "(track.jsonl)");
  for (const session::TrackRecord& record : recorded)
    for (const auto& [name, carrier] : record.carriers) recorded_carriers_.insert(name);
}

bool TrackStage::remembers() const {
  return set_.tracking.enabled &&
         std::ranges::any_of(set_.tracking.carriers, [this](const auto& carrier) {
           return !recorded_carriers_.contains(carrier.name);
         });
}

void TrackStage::operator()(Shot& shot) {
  const session::TrackRecord* record = recorded_->newest(shot.frame->timestamp_ns);
  track_camera(shot);
  follow_carriers(shot);
  if (record)
    for (const auto& [name, carrier] : record->carriers) carriers_[name] = carrier;
  place(shot, record);
  shot.tracking_done = true;
  if (const auto* own = recorded_->at(shot.frame->timestamp_ns); own && own->captured_light)
    shot.recorded_light = {recorded_, &*own->captured_light};
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
                                                          : "; what it carries is hidden"));
  }
}

void TrackStage::track_camera(Shot& shot) {
  if (shot.index != next_index_) tracker_->reset();
  next_index_ = shot.index + 1;
  shot.track = tracker_->track(*shot.frame);
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
  shot.scene.variants = record->scene.variants;
  shot.scene.hides_tags = record->scene.hides_tags;
  shot.scene.environment_turn_rad = record->scene.environment_turn_rad;
}

}  // namespace previz::pipeline
