#include "daemon/core/live/live_output.hpp"

#include <memory>
#include <utility>

#include "daemon/core/live/snapshots.hpp"
#include "daemon/core/output/shown_frame.hpp"
#include "daemon/core/report/report.hpp"
#include "drivers/error.hpp"

namespace previz::live {

using pipeline::Shot;
using report::Severity;

namespace {

set::Set with_calibration(set::Set set, const ObserverCalibration& calibration) {
  set.observer.calibration = calibration;
  return set;
}

}  // namespace

void count_picture(const Shot& shot, pipeline::Metrics& metrics, report::Reports& reports) {
  if (!shot.untouched.empty()) {
    // Without its figures, such as the numbers of tags, a reason is one of few.
    metrics.count("plate untouched: " + report::wording(shot.untouched));
    reports(report::once({Severity::warning, "plate untouched", shot.untouched}));
  }
  const render::Counters& counters = shot.counters;
  if (counters.rebuilt_trees > 0)
    metrics.count("trees of deforming meshes rebuilt", counters.rebuilt_trees);
  if (counters.below_zero > 0) metrics.count("pixels without light left", counters.below_zero);
  if (counters.dropped_not_finite + counters.dropped_negative + counters.stopped_in_layers +
          counters.unfinished ==
      0)
    return;
  metrics.count("non-finite samples", counters.dropped_not_finite);
  metrics.count("negative samples", counters.dropped_negative);
  metrics.count("rays stopped after too many transparent surfaces", counters.stopped_in_layers);
  metrics.count("paths cut short", counters.unfinished);
}

LiveOutput::LiveOutput(Parts parts, const ObserverCalibration& calibration)
    : parts_(std::move(parts)),
      calibrated_(with_calibration(parts_.set, calibration)),
      recording_("composite recording", parts_.kept, &pipeline::Patience::stage),
      displaying_("display", parts_.kept, &pipeline::Patience::stage) {}

// This runs on the display thread, so that the render thread need not make the recorder's frame of
// each picture.
void LiveOutput::show(Shot shot) {
  if (!shot.whole) return parts_.kept.metrics.dropped("display", "stopped while rendering");
  recording_.attempt([&] { record_shown(shot); });
  const bool is_shown = displaying_.attempt([&] {
    count_picture(shot, parts_.kept.metrics, parts_.kept.reports);
    parts_.show(std::move(shot));
  });
  if (!is_shown) parts_.kept.metrics.dropped("display", "failed");
}

// A review shows another take than the one that is being recorded.
void LiveOutput::record_shown(const Shot& shot) {
  const State state = parts_.look.get()->state;
  if (!parts_.set.recording.composite || !state.recording || state.mode == Mode::review) return;
  const PinholeIntrinsics& whole = calibrated_.observer.calibration->intrinsics;
  parts_.recorder.offer_shown(std::make_shared<Frame>(output::shown_frame(
      *shot.picture, whole.width, whole.height, shown_frames_++, shot.frame->timestamp_ns)));
}

void LiveOutput::write_snapshot(const Shot& shot) const {
  try {
    parts_.inbox.post({live::write_snapshot(shot, calibrated_).string() + ".exr and .png", true});
  } catch (const std::exception& error) {
    parts_.inbox.post({reason_of(error), false});
  }
}

}  // namespace previz::live
