// Measures what a machine can do with previzd, before anybody relies on it: `previzd bench`.
#pragma once

#include <filesystem>
#include <iosfwd>
#include <optional>
#include <stop_token>

#include "daemon/bench/figures.hpp"
#include "daemon/core/render/device/gpu.hpp"

namespace previz::bench {

struct BenchOptions {
  // A set or a take, whose rate is measured, too.
  std::optional<std::filesystem::path> set_or_session;
  std::optional<std::filesystem::path> json, page;  // files to write
  double seconds = 100;  // what would last longer than is left of these is left out, and named
  render::DeviceOptions device;
  std::stop_token stop;
};

// Throws previz::Error where there is no device, or where a file cannot be read or written. What
// is being measured goes to `out`, a line each, and the table before the files are written.
BenchReport run_bench(const BenchOptions& options, std::ostream& out);

}  // namespace previz::bench
