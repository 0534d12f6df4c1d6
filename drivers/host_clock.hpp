// The host's monotonic time, passed in so that a test can hold it still.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <thread>

namespace previz {

// Returns the time on CLOCK_MONOTONIC, which is steady_clock's in libstdc++ and that of every time
// stamp.
inline std::int64_t monotonic_ns() {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

struct HostClock {
  using Time = std::chrono::steady_clock::time_point;  // CLOCK_MONOTONIC in libstdc++
  std::function<Time()> now = [] { return std::chrono::steady_clock::now(); };
  std::function<void(Time)> sleep_until = [](Time time) { std::this_thread::sleep_until(time); };
};

}  // namespace previz
