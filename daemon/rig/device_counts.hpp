// A device's own counters, brought into the metrics.
#pragma once

#include <string>
#include <utility>

#include "daemon/pipeline/metrics.hpp"
#include "drivers/device.hpp"

namespace previz::rig {

// The metrics outlive the device: with every set that is loaded it is opened, and counts, anew.
// What is told is therefore what came on top.
class DeviceCounts {
 public:
  DeviceCounts(pipeline::Metrics& metrics, std::string device)
      : metrics_(metrics), device_(std::move(device)) {}

  void tell(const DeviceCounters& totals) {
    DeviceCounters more;
    for (const auto& [what, total] : totals) more[what] = total - told_[what];
    metrics_.device_counted(device_, more);
    told_ = totals;
  }

 private:
  pipeline::Metrics& metrics_;
  std::string device_;
  DeviceCounters told_;
};

}  // namespace previz::rig
