#include "daemon/pipeline/recorded_light.hpp"

#include <utility>

#include "drivers/error.hpp"

namespace previz::pipeline {

RecordedLight::RecordedLight(const set::Set& set, std::optional<LightCameraCalibration> calibration,
                             const ObserverCalibration& observer,
                             std::unique_ptr<session::StreamReader> stream,
                             const std::filesystem::path& session_directory)
    : stage_(set, std::move(calibration), observer), stream_(std::move(stream)) {
  if (stage_.needs_frames() && !stream_)
    throw Error(session_directory.string() +
                ": the session has no light frames, and the set gives no lighting.environment");
}

LightPtr RecordedLight::at(const Shot& shot) {
  while (stage_.needs_frames() && next_ < stream_->records().size() &&
         stream_->records()[next_].timestamp_ns <= shot.frame->timestamp_ns) {
    stage_.see(stream_->read(next_), next_);
    ++next_;
  }
  if (shot.track.pose) stage_.see_observer(*shot.frame, shot.track.pose->world_from_camera);
  return stage_.light_for(shot);
}

}  // namespace previz::pipeline
