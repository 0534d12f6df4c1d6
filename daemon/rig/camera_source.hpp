// Frames of a camera for the pipeline; trouble is noted, counted and told to the desk.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "daemon/pipeline/metrics.hpp"
#include "daemon/rig/device_counts.hpp"
#include "daemon/rig/faults.hpp"
#include "daemon/rig/notes.hpp"
#include "drivers/camera.hpp"

namespace previz::rig {

class CameraSource {
 public:
  struct Told {
    std::stop_token stop;
    Notes& note;
    pipeline::Metrics& metrics;
    Faults& faults;
    double silence_s;  // a camera counts as lost once it has said so, or said nothing for so long
    std::function<void(bool lost)> presence;  // told when it changes
  };
  // Metrics are counted under the stage's name; the crew is told of trouble under its own.
  CameraSource(Camera& camera, std::string stage, std::string crews_name, Told told);

  // The next frame; null at the end of the stream, or once a stop is requested.
  FramePtr next();

  // By so many stops from what the last frame had.
  void change_exposure(double stops);

 private:
  void trouble(const DeviceTrouble& trouble);
  void lose();
  void arrived(const Frame& frame);

  Camera& camera_;
  const std::string stage_, crews_name_;
  Told told_;
  DeviceCounts counts_;
  bool lost_ = false;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
  std::optional<std::uint64_t> last_sequence_;
  double exposure_s_ = 0, gain_ = 1;  // of the last frame
};

}  // namespace previz::rig
