// The light of a recorded take: at every frame that of the newest light frames before it.
#pragma once

#include <memory>
#include <optional>

#include "daemon/pipeline/light_stage.hpp"
#include "drivers/session/session.hpp"

namespace previz::pipeline {

class RecordedLight {
 public:
  // Throws previz::Error if `stream` is null and the set gives no environment file.
  RecordedLight(const set::Set& set, std::optional<LightCameraCalibration> calibration,
                std::unique_ptr<session::StreamReader> stream,
                const std::filesystem::path& session_directory);

  // Times in order. Null: no light frame precedes this time.
  LightPtr at(std::int64_t timestamp_ns);

 private:
  LightStage stage_;
  std::unique_ptr<session::StreamReader> stream_;
  std::size_t next_ = 0;
};

}  // namespace previz::pipeline
