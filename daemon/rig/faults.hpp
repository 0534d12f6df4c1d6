// What is wrong with the rig's devices now, in plain words for the display.
#pragma once

#include <algorithm>
#include <chrono>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace previz::rig {

// From any thread. One fault a device, the last one told; it stays until the device is well, and
// long enough to be read.
class Faults {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds reading_time{4};

  void tell(const std::string& device, const std::string& what,
            Clock::time_point now = Clock::now()) {
    const std::lock_guard lock(mutex_);
    faults_[device] = {what, now, true};
  }
  // What is over already, and is told all the same.
  void pass(const std::string& device, const std::string& what) {
    tell(device, what);
    well(device);
  }
  void well(const std::string& device) {
    const std::lock_guard lock(mutex_);
    const auto found = faults_.find(device);
    if (found != faults_.end()) found->second.lasts = false;
  }

  // "film camera: was unplugged", by device.
  std::vector<std::string> words(Clock::time_point now = Clock::now()) {
    const std::lock_guard lock(mutex_);
    std::erase_if(faults_, [&](const auto& fault) {
      return !fault.second.lasts && now - fault.second.told >= reading_time;
    });
    std::vector<std::string> all;
    for (const auto& [device, fault] : faults_) all.push_back(device + ": " + fault.what);
    return all;
  }

 private:
  struct Fault {
    std::string what;
    Clock::time_point told;
    bool lasts = true;
  };

  std::mutex mutex_;
  std::map<std::string, Fault> faults_;
};

}  // namespace previz::rig
