#include "daemon/core/live/gpu_keeper.hpp"

#include <algorithm>

namespace previz::live {

using report::Severity;

namespace {

constexpr const char* graphics_device = "graphics card";  // as the crew calls it

}  // namespace

void GpuKeeper::say_lost(const std::string& what) {
  parts_.reports(
      report::counted({.severity = Severity::error,
                       .source = "",
                       .text = what + "; reopening it",
                       .notice = report::lasting(graphics_device, "is lost; reopening it")}));
  parts_.metrics.count("device lost");
  gpu_.drop();
}

void GpuKeeper::start() {
  is_built_ = false;
  try {
    if (!gpu_.is_open()) gpu_.open();
  } catch (const std::exception& error) {
    return say_lost(error.what());
  }
  try {
    build();
  } catch (const render::DeviceLost& lost) {
    say_lost(lost.what());
  }
}

void GpuKeeper::build() {
  gpu_.build();
  is_built_ = true;
  parts_.reports.settle(graphics_device);
  if (gpu_.stands_in())
    parts_.reports.show(report::lasting(graphics_device, "is gone; rendering on the CPU, slowly"));
}

bool GpuKeeper::renew(const render::DeviceLost& lost) {
  is_built_ = false;
  say_lost(lost.what());
  return await();
}

bool GpuKeeper::await() {
  std::chrono::milliseconds delay = parts_.patience;
  while (!is_built_ && !parts_.stop.stop_requested()) {
    try {
      gpu_.open();
      build();
      parts_.metrics.count("device reopened");
      parts_.reports({Severity::info, "", "rendering again, on " + gpu_.name()});
    } catch (const std::exception& error) {
      parts_.reports(report::once({Severity::error, "", error.what()}));
      gpu_.drop();
      parts_.meanwhile(delay);
      delay = std::min(2 * delay, parts_.longest_patience);
    }
  }
  return is_built_;
}

}  // namespace previz::live
