// What the rig does, as files: the newest picture and the metrics.
#pragma once

#include <chrono>
#include <filesystem>
#include <memory>

#include "daemon/pipeline/metrics.hpp"
#include "drivers/frame.hpp"

namespace previz::rig {

class LiveFiles {
 public:
  // Makes the directory; throws previz::Error if it cannot.
  LiveFiles(std::filesystem::path directory, const pipeline::Metrics& metrics);

  // Writes about once a second; from one thread.
  void take(std::shared_ptr<const Plate> picture);
  // What the pipeline did so far; from any thread.
  pipeline::MetricsSnapshot metrics() const;
  // Writes picture.png (if there was any) and metrics.json.
  pipeline::MetricsSnapshot write();

 private:
  using Clock = std::chrono::steady_clock;

  const std::filesystem::path directory_;
  const pipeline::Metrics& metrics_;
  const Clock::time_point start_ = Clock::now();
  Clock::time_point written_ = start_;
  std::shared_ptr<const Plate> picture_;
};

}  // namespace previz::rig
