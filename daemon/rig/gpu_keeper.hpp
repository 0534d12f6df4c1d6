// Rebuilds the renderer after a loss of the graphics device.
#pragma once

#include <chrono>
#include <functional>
#include <stop_token>
#include <string>

#include "daemon/pipeline/metrics.hpp"
#include "daemon/render/renderer.hpp"
#include "daemon/report/reports.hpp"

namespace previz::rig {

class GpuKeeper {
 public:
  // The operations on the device and its renderer; every call may throw render::DeviceLost.
  struct Gpu {
    std::function<bool()> is_open;
    std::function<void()> open;  // opens the device again after a loss
    std::function<std::string()> name;
    std::function<void()> build;  // makes the renderer
    std::function<void()> drop;   // destroys the renderer
  };
  struct Parts {  // references outlive the keeper
    report::Reports& reports;
    pipeline::Metrics& metrics;
    std::stop_token stop;
    std::chrono::milliseconds patience{500};  // time between attempts to open the device
  };

  GpuKeeper(Gpu gpu, Parts parts) : gpu_(std::move(gpu)), parts_(std::move(parts)) {}

  // Builds the renderer, even if the device was lost before this set. Throws whatever keeps it from
  // being built, and DeviceLost if a stop comes first.
  void start();

  // Drops the renderer and tries until it is rebuilt; returns false if a stop came first. Call it
  // from the render thread: nobody waits for that thread, and frames still reach the recorder.
  bool renew(const render::DeviceLost& lost);

 private:
  const Gpu gpu_;
  const Parts parts_;
};

}  // namespace previz::rig
