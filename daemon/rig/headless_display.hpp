// The display of a rig without one: the newest picture and the metrics as files.
#pragma once

#include <chrono>
#include <filesystem>

#include "daemon/pipeline/metrics.hpp"
#include "daemon/pipeline/shot.hpp"

namespace previz::rig {

// Latency is from the capture time to the call of show(): the device's own part (arrival minus
// capture, as the driver reports it) and ours.
class HeadlessDisplay {
 public:
  // Makes the directory; throws previz::Error if it cannot.
  HeadlessDisplay(std::filesystem::path directory, pipeline::Metrics& metrics);

  void show(pipeline::Shot shot);
  // What the pipeline did so far; from any thread.
  pipeline::MetricsSnapshot metrics() const;
  // Writes picture.png (if anything was shown) and metrics.json.
  pipeline::MetricsSnapshot write();

 private:
  using Clock = std::chrono::steady_clock;

  const std::filesystem::path directory_;
  pipeline::Metrics& metrics_;
  const Clock::time_point start_ = Clock::now();
  Clock::time_point written_ = start_;
  Plate picture_;
};

}  // namespace previz::rig
