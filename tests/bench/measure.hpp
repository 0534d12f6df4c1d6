// Clocks, mean and median for the benchmarks.
#pragma once

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <numeric>
#include <vector>

namespace previz::bench {

// CPU time of all threads of this process: on a busy machine the only fair clock for a device that
// is the CPU.
inline double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

// Time of something on the clock, and of all threads.
struct Times {
  double wall_ms = 0, cpu_ms = 0;
};

template <class Run>
Times time_of(const Run& run) {
  const auto start = std::chrono::steady_clock::now();
  const double cpu_start = cpu_seconds();
  run();
  const std::chrono::duration<double, std::milli> wall = std::chrono::steady_clock::now() - start;
  return {wall.count(), 1e3 * (cpu_seconds() - cpu_start)};
}

inline double mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// Returns the median of at least one value; of an even number, the upper of the middle two.
inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace previz::bench
