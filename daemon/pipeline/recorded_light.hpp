// The light of a recorded take: at every frame that of the newest light frames before it.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/pipeline/light_stage.hpp"
#include "drivers/session/session.hpp"

namespace previz::pipeline {

class RecordedLight {
 public:
  // Throws previz::Error if `stream` is null and the set gives no environment file.
  RecordedLight(const set::Set& set, std::optional<LightCameraCalibration> calibration,
                const ObserverCalibration& observer, std::unique_ptr<session::StreamReader> stream,
                const std::filesystem::path& session_directory);

  // Shots in order, tracked. Null: no light frame precedes this one.
  LightPtr at(const Shot& shot);

  bool remembers() const { return stage_.remembers(); }
  std::vector<std::string> troubles() { return stage_.troubles(); }

 private:
  LightStage stage_;
  std::unique_ptr<session::StreamReader> stream_;
  std::size_t next_ = 0;
};

}  // namespace previz::pipeline
