// The host's monotonic time, passed in so that a test can hold it still; and arithmetic on times.
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

// The times of a device or a recording can be anything; arithmetic on them wraps rather than
// overflows.
inline std::int64_t wrapping_sum(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) + static_cast<std::uint64_t>(b));
}
inline std::int64_t wrapping_difference(std::int64_t a, std::int64_t b) {
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b));
}

struct HostClock {
  using Time = std::chrono::steady_clock::time_point;  // CLOCK_MONOTONIC in libstdc++
  std::function<Time()> now = [] { return std::chrono::steady_clock::now(); };
  std::function<void(Time)> sleep_until = [](Time time) { std::this_thread::sleep_until(time); };
};

}  // namespace previz
