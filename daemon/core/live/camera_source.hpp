// Delivers a camera's frames to the pipeline, counts the camera's troubles and reports them to the
// crew.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/pipeline/stage_keeper.hpp"
#include "drivers/camera.hpp"

namespace previz::live {

class CameraSource {
 public:
  struct Parts {  // references outlive the source
    std::stop_token stop;
    pipeline::StageKeeper::Parts kept;
    double silence_s;  // a camera counts as lost when it says so, or sends nothing for so long
    std::function<void(bool lost)> presence;  // called when that changes; may be empty
  };
  // Metrics count under the stage's name; the display uses the crew's name for the camera.
  CameraSource(Camera& camera, std::string stage, std::string crews_name, Parts parts);

  // Waits for the next frame; returns null at the end of the stream, or once a stop is requested.
  // What the driver throws counts as trouble of the device, which is asked again.
  FramePtr next();

  // Sets an exposure that is longer or shorter than the last frame's by so many stops.
  void change_exposure(double stops);

 private:
  FramePtr ask();
  void failed(const std::string& what);
  // With `is_event` the log has a line each time; otherwise it may come at every call.
  void trouble(const DeviceTrouble& trouble, bool is_event);
  void look_at_silence();
  void lose();
  void arrived(const Frame& frame);

  Camera& camera_;
  const std::string stage_, crews_name_;
  Parts parts_;
  pipeline::DeviceCounts counts_;
  pipeline::Liveness::Pulse pulse_;
  bool has_ended_ = false;
  bool lost_ = false;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
  std::optional<std::uint64_t> last_sequence_;
  double exposure_s_ = 0, gain_ = 1;  // the last frame's
};

}  // namespace previz::live
