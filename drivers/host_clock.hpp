// The host's monotonic time, passed in so that a test can hold it still.
#pragma once

#include <chrono>
#include <functional>
#include <thread>

namespace previz {

struct HostClock {
  using Time = std::chrono::steady_clock::time_point;  // CLOCK_MONOTONIC in libstdc++
  std::function<Time()> now = [] { return std::chrono::steady_clock::now(); };
  std::function<void(Time)> sleep_until = [](Time time) { std::this_thread::sleep_until(time); };
};

}  // namespace previz
