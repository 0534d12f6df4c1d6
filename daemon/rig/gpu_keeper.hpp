// Keeps what renders alive through losses of the graphics device.
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
  // What is done to the device and to what renders on it; every call may throw render::DeviceLost.
  struct Gpu {
    std::function<bool()> is_open;
    std::function<void()> open;  // again, after a loss
    std::function<std::string()> name;
    std::function<void()> build;  // makes what renders
    std::function<void()> drop;   // and takes it away
  };
  struct Parts {  // references outlive the keeper
    report::Reports& reports;
    pipeline::Metrics& metrics;
    std::stop_token stop;
    std::chrono::milliseconds patience{500};  // from one attempt to open the device to the next
  };

  GpuKeeper(Gpu gpu, Parts parts) : gpu_(std::move(gpu)), parts_(std::move(parts)) {}

  // Builds what renders, also where the device was lost before this set. Throws what keeps it from
  // being built, and DeviceLost if a stop comes first.
  void start();

  // Drops what was rendering, and tries until it is built anew: from the render thread, for which
  // nobody waits while frames go on into the recorder. False: a stop came first.
  bool renew(const render::DeviceLost& lost);

 private:
  const Gpu gpu_;
  const Parts parts_;
};

}  // namespace previz::rig
