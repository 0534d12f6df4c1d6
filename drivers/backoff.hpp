// Decides how long to wait between attempts to open a device that is not there: each wait doubles,
// up to a limit.
#pragma once

#include <algorithm>
#include <chrono>

#include "drivers/host_clock.hpp"

namespace previz {

struct BackoffLimits {
  std::chrono::milliseconds first{250}, last{4000};
};

class Backoff {
 public:
  explicit Backoff(const BackoffLimits& limits) : limits_(limits) {}

  bool due(HostClock::Time now) const { return now >= at_; }
  HostClock::Time at() const { return at_; }
  void failed(HostClock::Time now) {
    wait_ = std::clamp(2 * wait_, limits_.first, limits_.last);
    at_ = now + wait_;
  }
  // Ends the wait; after the next failure it is as short as at first.
  void reset() {
    wait_ = std::chrono::milliseconds(0);
    at_ = {};
  }

 private:
  const BackoffLimits limits_;
  std::chrono::milliseconds wait_{0};
  HostClock::Time at_{};
};

}  // namespace previz
