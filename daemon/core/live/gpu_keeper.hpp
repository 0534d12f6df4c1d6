// Rebuilds the renderer after a loss of the graphics device.
#pragma once

#include <chrono>
#include <functional>
#include <stop_token>
#include <string>

#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/render/renderer.hpp"
#include "daemon/core/report/reports.hpp"

namespace previz::live {

class GpuKeeper {
 public:
  // The operations on the device and its renderer; every call may throw render::DeviceLost.
  struct Gpu {
    std::function<bool()> is_open;
    std::function<void()> open;  // opens the device again after a loss
    std::function<std::string()> name;
    std::function<bool()> stands_in;  // it is a CPU device in place of a GPU
    std::function<void()> build;      // makes the renderer
    std::function<void()> drop;       // destroys the renderer
  };
  struct Parts {  // references outlive the keeper
    report::Reports& reports;
    pipeline::Metrics& metrics;
    std::stop_token stop;
    // Passes the time between two attempts, at most so long.
    std::function<void(std::chrono::milliseconds)> meanwhile;
    // The time between the first two attempts; it doubles each time, up to the longest.
    std::chrono::milliseconds patience{500}, longest_patience{8000};
  };

  GpuKeeper(Gpu gpu, Parts parts) : gpu_(std::move(gpu)), parts_(std::move(parts)) {}

  // Builds the renderer, and opens the device if it was lost before this set. Where there is none,
  // await() does both. Throws whatever else keeps the renderer from being built.
  void start();

  // Call these from the render thread: nobody waits for that thread, and frames still reach the
  // recorder. Both return false if a stop came first.
  bool await();                                // returns at once if the renderer was built
  bool renew(const render::DeviceLost& lost);  // drops the renderer and tries until it is rebuilt

 private:
  void say_lost(const std::string& what);
  void build();

  const Gpu gpu_;
  const Parts parts_;
  bool is_built_ = false;
};

}  // namespace previz::live
