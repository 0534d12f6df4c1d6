#include "daemon/core/output/memory.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cinttypes>
#include <cstdio>
#include <fstream>
#include <string>

namespace previz::output {

std::uint64_t memory_bytes() {
  return static_cast<std::uint64_t>(std::max(0L, ::sysconf(_SC_PHYS_PAGES))) *
         static_cast<std::uint64_t>(std::max(0L, ::sysconf(_SC_PAGE_SIZE)));
}

std::uint64_t most_queue_bytes(std::uint64_t memory) {
  return memory / 4 * 3;
}

std::optional<std::uint64_t> free_memory_bytes() {
  std::ifstream file("/proc/meminfo");
  for (std::string line; std::getline(file, line);) {
    std::uint64_t kib = 0;
    if (std::sscanf(line.c_str(), "MemAvailable: %" SCNu64 " kB", &kib) == 1) return kib * 1024;
  }
  return std::nullopt;
}

std::uint64_t peak_memory_bytes() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return 1024 * static_cast<std::uint64_t>(usage.ru_maxrss);
}

std::uint64_t queue_bytes(std::optional<double> wished_mb, std::uint64_t memory) {
  constexpr std::uint64_t least = 256'000'000;
  if (wished_mb)
    return std::min(static_cast<std::uint64_t>(*wished_mb * 1e6), most_queue_bytes(memory));
  return std::max(least, free_memory_bytes().value_or(0) / 4);
}

}  // namespace previz::output
