// What benchmarks measure with.
#pragma once

#include <sys/resource.h>

#include <algorithm>
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

// The upper one of an even number. At least one value.
inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace previz::bench
