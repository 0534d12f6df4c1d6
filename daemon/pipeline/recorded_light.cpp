#include "daemon/pipeline/recorded_light.hpp"

#include <utility>

#include "drivers/error.hpp"

namespace previz::pipeline {

RecordedLight::RecordedLight(const set::Set& set, std::optional<LightCameraCalibration> calibration,
                             std::unique_ptr<session::StreamReader> stream,
                             const std::filesystem::path& session_directory)
    : stage_(set, std::move(calibration)), stream_(std::move(stream)) {
  if (stage_.needs_frames() && !stream_)
    throw Error(session_directory.string() +
                ": the session has no light frames, and the set gives no lighting.environment");
}

LightPtr RecordedLight::at(std::int64_t timestamp_ns) {
  while (stage_.needs_frames() && next_ < stream_->records().size() &&
         stream_->records()[next_].timestamp_ns <= timestamp_ns) {
    stage_.see(stream_->read(next_), next_);
    ++next_;
  }
  return stage_.light();
}

}  // namespace previz::pipeline
