#include "daemon/core/live/live_light.hpp"

#include <utility>

#include "daemon/core/pipeline/relight.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::live {

using pipeline::LightPtr;
using report::Severity;

LiveLight::LiveLight(Parts parts, const std::optional<LightCameraCalibration>& calibration,
                     const ObserverCalibration& observer)
    : parts_(std::move(parts)),
      make_stage_([this, calibration, observer] {
        stage_.emplace(parts_.set, calibration, observer, &parts_.scene);
        stage_->await_bracket(bracket_);
      }),
      needs_frames_((make_stage_(), stage_->needs_frames())),
      needs_observer_(stage_->needs_observer()),
      observer_width_(observer.intrinsics.width),
      observer_height_(observer.intrinsics.height),
      keeper_("lighting", parts_.kept, &pipeline::Patience::stage, make_stage_) {
  if (needs_frames_ && !parts_.has_camera)
    throw Error(parts_.set.file.string() +
                ": lighting: the set has neither a light camera nor lighting.environment");
}

void LiveLight::start(pipeline::StageThreads& stages, std::function<FramePtr()> next_frame) {
  feed_.start(
      stages,
      [next = std::move(next_frame),
       index = std::uint64_t{0}]() mutable -> std::optional<pipeline::LightFrame> {
        FramePtr frame = next();
        if (!frame) return std::nullopt;
        return pipeline::LightFrame{std::move(frame), index++};
      },
      [this](std::vector<pipeline::LightFrame> frames,
             const std::optional<pipeline::ObserverView>& view) {
        return estimate(std::move(frames), view);
      });
}

LightPtr LiveLight::estimate(std::vector<pipeline::LightFrame> frames,
                             const std::optional<pipeline::ObserverView>& view) {
  if (needs_frames() && !keeper_.attempt([&] { update(frames, view); }))
    parts_.kept.metrics.dropped("lighting", "failed", frames.size());
  return last_;
}

// Estimates the light from the frames; while tracking rests, the light stays as it was.
void LiveLight::update(std::vector<pipeline::LightFrame>& frames,
                       const std::optional<pipeline::ObserverView>& view) {
  if (view) stage_->see_observer(*view->plate, view->exposure, view->world_from_camera);
  for (const pipeline::LightFrame& waited : frames)
    stage_->see(demosaiced(waited.frame), waited.index);
  for (const std::string& trouble : stage_->troubles()) {
    parts_.kept.reports(report::once({.severity = Severity::warning,
                                      .source = "light",
                                      .text = trouble,
                                      .notice = report::passing("light", trouble)}));
    parts_.kept.metrics.dropped("lighting", "not usable");
  }
  const std::shared_ptr<const Look> look = parts_.look.get();
  if (!tracks(look->state)) {
    parts_.kept.metrics.count("light frames not evaluated in this mode", frames.size());
    return;
  }
  stage_->use(look->light_mode);
  const LightPtr light = stage_->light();
  if (!light) return;  // a stage that was begun anew has seen nothing yet
  // The lamps that the crew has changed are parted from an image here, so that no picture waits.
  last_ = pipeline::with_lamps_parted(light, parts_.set,
                                      pipeline::scene_state(parts_.set, look->edits));
  for (const std::string& what : last_->lighting.report.notes)
    parts_.kept.reports(report::once({Severity::info, "light", what}));
}

LightPtr LiveLight::light_for(const pipeline::Shot& shot, set::LightMode mode) {
  if (needs_frames()) return feed_.newest();
  stage_->use(mode);
  for (const std::string& trouble : stage_->troubles())
    parts_.kept.reports(report::once({Severity::warning, "light", trouble}));
  return stage_->light_for(shot);
}

// A picture of another size, as from a camera that was exchanged, does not fit the calibration.
void LiveLight::see_observer(pipeline::Shot& shot) {
  if (!needs_observer_ || !shot.track.pose) return;
  if (shot.frame->width != observer_width_ || shot.frame->height != observer_height_) return;
  feed_.see_observer({plate_of(shot), shot.frame->exposure, shot.track.pose->world_from_camera});
}

}  // namespace previz::live
