#include "daemon/rig/gpu_keeper.hpp"

#include <thread>
#include <utility>

namespace previz::rig {

using report::Severity;

namespace {

constexpr const char* graphics_device = "graphics device";  // as the crew calls it

}  // namespace

void GpuKeeper::start() {
  try {
    if (!gpu_.is_open()) gpu_.open();
    gpu_.build();
  } catch (const render::DeviceLost& lost) {
    if (!renew(lost)) throw;
  }
}

bool GpuKeeper::renew(const render::DeviceLost& lost) {
  parts_.reports({.severity = Severity::error,
                  .source = "",
                  .text = std::string(lost.what()) + "; it is opened again",
                  .notice = report::lasting(graphics_device, "is lost; it is opened again")});
  parts_.metrics.count("device lost");
  gpu_.drop();
  while (!parts_.stop.stop_requested()) {
    try {
      gpu_.open();
      gpu_.build();
      parts_.reports.settle(graphics_device);
      parts_.metrics.count("device opened again");
      parts_.reports({Severity::info, "", "pictures again, on " + gpu_.name()});
      return true;
    } catch (const std::exception& error) {
      parts_.reports(report::once({Severity::error, "", error.what()}));
      gpu_.drop();
      std::this_thread::sleep_for(parts_.patience);
    }
  }
  return false;
}

}  // namespace previz::rig
