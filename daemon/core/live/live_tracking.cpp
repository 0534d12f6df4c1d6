#include "daemon/core/live/live_tracking.hpp"

#include <utility>

#include "daemon/core/report/report.hpp"
#include "drivers/error.hpp"

namespace previz::live {

using pipeline::Shot;
using report::Severity;

namespace {

// Half a second to a second of frames decides about a tag, and as much after it is back.
constexpr int frames_remembered = 24, frames_decisive = 12;

session::TrackRecord track_record_of(const Shot& shot) {
  session::TrackRecord record;
  record.timestamp_ns = shot.frame->timestamp_ns;
  record.tracked = shot.track.pose.has_value();
  if (shot.track.pose) {
    record.world_from_camera = shot.track.pose->world_from_camera;
    record.covariance = shot.track.pose->covariance;
    record.tags = shot.track.pose->tags;
  }
  record.scene = shot.scene;
  record.carriers = shot.motion.carriers;
  if (shot.light) record.captured_light = shot.light->record;
  return record;
}

}  // namespace

LiveTracking::LiveTracking(Parts parts, const ObserverCalibration& calibration)
    : parts_(std::move(parts)),
      calibration_(calibration),
      tracking_("tracking", parts_.kept, &pipeline::Patience::stage, [this] { make_stage(); }),
      lighting_("picture lighting", parts_.kept, &pipeline::Patience::stage),
      doubts_(parts_.set.tracking, calibration_, parts_.kept.reports) {
  make_stage();
}

void LiveTracking::make_stage() {
  const set::Tracking& wish = parts_.set.tracking;
  stage_.emplace(parts_.set, calibration_, parts_.cameras.recorded.track, 0, parts_.cameras.lap_ns,
                 wish.search_parts ? tracking::Search::parts : tracking::Search::whole);
  trust_.emplace(wish, calibration_.intrinsics, frames_remembered);
  moved_.clear();
  parts_.kept.reports.settle("tags");
  filter_.reset();
  if (wish.enabled && (wish.smooth || wish.hold_s > 0))
    filter_.emplace(wish, calibration_.intrinsics);
}

void LiveTracking::report_carriers(const Shot& shot) {
  for (const std::string& trouble : stage_->troubles()) {
    parts_.kept.reports(report::once({Severity::warning, "", trouble}));
    parts_.kept.metrics.count("carrier not found");
  }
  for (const set::Carrier& carrier : parts_.set.tracking.carriers) {
    const auto where = shot.motion.carriers.find(carrier.name);
    if (where != shot.motion.carriers.end() && !where->second.tags.empty())
      parts_.kept.reports.settle(carrier.name);
    else
      parts_.kept.reports.show(report::lasting(carrier.name, "is not in the picture"));
  }
}

void LiveTracking::judge_tags(const Shot& shot) {
  trust_->add(shot.track);
  std::set<int> moved = trust_->moved(frames_decisive);
  if (moved == moved_) return;
  moved_ = std::move(moved);
  stage_->leave_out(moved_);
  doubts_.forget();  // the poses will be others
  std::string text;
  for (const int id : moved_)
    add_to_list(text, "tag " + std::to_string(id) + " " + trust_->words(id), "; ");
  if (text.empty()) return parts_.kept.reports.settle("tags");
  report::Report report{Severity::warning, "tracking", text};
  report.notice = report::Notice{Severity::warning, "tags", text, true};
  parts_.kept.reports(report::once(std::move(report)));
}

Shot LiveTracking::track(Shot shot) {
  const std::shared_ptr<const Look> look = parts_.look.get();
  const double animation_s =
      animation_clock_.at(shot.frame->timestamp_ns, look->plays, look->animations_held);
  if (!tracks(look->state)) {
    parts_.kept.metrics.count("frames not tracked in this mode");
    return shot;
  }
  const bool is_tracked = tracking_.attempt([&] {
    (*stage_)(shot);
    report_carriers(shot);
    judge_tags(shot);
    doubts_.add(shot.track);
  });
  if (!is_tracked) {
    shot.track = {};
    shot.track.reason = "tracking has failed";
    shot.motion = {};
    shot.tracking_done = true;
  }
  if (filter_) shot.shown_pose = filter_->shown(shot.track, shot.frame->timestamp_ns);
  if (shot.shown_pose && !shot.track.pose) parts_.kept.metrics.count("predicted poses");
  shot.motion.animation_s = animation_s;
  if (look->edits.environment_turn_rad != 0)
    shot.scene.environment_turn_rad = look->edits.environment_turn_rad;
  lighting_.attempt([&] {
    shot.light = parts_.light.light_for(shot, look->light_mode);
    parts_.light.see_observer(shot);
  });
  offer_line(shot, look->edits);
  return shot;
}

void LiveTracking::offer_line(Shot& shot, const pipeline::Edits& edits) {
  try {
    shot.scene = pipeline::scene_state(parts_.set, edits, shot.motion);
    parts_.recorder.offer(track_record_of(shot));
  } catch (const std::exception& error) {
    parts_.kept.metrics.count("tracking lines not recorded");
    parts_.kept.reports(report::once({Severity::error, "tracking", reason_of(error)}));
  }
}

}  // namespace previz::live
