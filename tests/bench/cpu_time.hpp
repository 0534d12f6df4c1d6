// CPU time of all threads of this process, in seconds: on a busy machine the only fair clock for a
// device that is the CPU.
#pragma once

#include <sys/resource.h>

namespace previz::bench {

inline double cpu_seconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

}  // namespace previz::bench
