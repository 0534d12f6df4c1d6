#include "daemon/rig/live_light.hpp"

#include <utility>

#include "daemon/pipeline/relight.hpp"

namespace previz::rig {

using pipeline::LightPtr;
using report::Severity;

LiveLight::LiveLight(Parts parts, const std::optional<LightCameraCalibration>& calibration,
                     const ObserverCalibration& observer)
    : parts_(parts), stage_(parts.set, calibration, observer, &parts.scene) {}

void LiveLight::start(pipeline::StageThreads& stages, std::function<FramePtr()> next_frame) {
  feed_.start(
      stages,
      [next = std::move(next_frame),
       index = std::uint64_t{0}]() mutable -> std::optional<pipeline::LightFrame> {
        const FramePtr frame = next();
        if (!frame) return std::nullopt;
        return pipeline::LightFrame{demosaiced(frame), index++};
      },
      [this](std::vector<pipeline::LightFrame> frames,
             const std::optional<pipeline::ObserverView>& view) {
        return estimate(std::move(frames), view);
      });
}

// Estimates the light from the frames; while tracking rests, the light stays as it was.
LightPtr LiveLight::estimate(std::vector<pipeline::LightFrame> frames,
                             const std::optional<pipeline::ObserverView>& view) {
  if (!needs_frames()) return nullptr;
  if (view) stage_.see_observer(*view->plate, view->exposure, view->world_from_camera);
  for (pipeline::LightFrame& waited : frames) stage_.see(std::move(waited.frame), waited.index);
  for (const std::string& trouble : stage_.troubles()) {
    parts_.reports(report::once({.severity = Severity::warning,
                                 .source = "light",
                                 .text = trouble,
                                 .notice = report::passing("light", trouble)}));
    parts_.metrics.dropped("lighting", "not usable");
  }
  const std::shared_ptr<const Look> look = parts_.look.get();
  if (!tracks(look->state)) {
    parts_.metrics.count("light frames that estimation rested", frames.size());
    return last_;
  }
  stage_.use(look->light_mode);
  // The lamps that the crew has changed are parted from an image here, so that no picture waits.
  last_ = pipeline::with_lamps_parted(stage_.light(), parts_.set,
                                      pipeline::scene_state(parts_.set, look->edits));
  if (last_)
    for (const std::string& what : last_->lighting.report.notes)
      parts_.reports(report::once({Severity::info, "light", what}));
  return last_;
}

LightPtr LiveLight::light_for(const pipeline::Shot& shot, set::LightMode mode) {
  if (needs_frames()) return feed_.newest();
  stage_.use(mode);
  for (const std::string& trouble : stage_.troubles())
    parts_.reports(report::once({Severity::warning, "light", trouble}));
  return stage_.light_for(shot);
}

void LiveLight::see_observer(pipeline::Shot& shot) {
  if (stage_.needs_observer() && shot.track.pose)
    feed_.see_observer({plate_of(shot), shot.frame->exposure, shot.track.pose->world_from_camera});
}

}  // namespace previz::rig
