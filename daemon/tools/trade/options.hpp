// What `previz trade` is asked for.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/core/render/renderer.hpp"
#include "daemon/core/timing/frame.hpp"

namespace previz::trade {

// With fewer samples in both halves a reference tells nothing.
inline constexpr int least_reference_samples = 32;

struct TradeOptions {
  timing::FrameSource source;
  // The rate and the error that are asked for; absent: quality.fps, or 25, and 2 %.
  std::optional<double> fps, error;
  bool answers = false;                            // search the settings for them
  std::optional<std::uint64_t> frame;              // absent: the first with a pose and light
  std::optional<std::filesystem::path> directory;  // absent: trade/ in the set's output directory
  double scale = 0.25;                             // of the observer's size, above 0 and at most 1
  std::vector<std::string> axes;                   // by name; empty: all
  std::vector<int> samples = {1, 2, 4, 8, 16};     // per pixel
  // Samples of both halves together, at least least_reference_samples; absent: 256 times the
  // largest of `samples`, so that the reference's error is about a sixteenth of the set's own best.
  std::optional<int> reference_samples;
  std::optional<double> minutes;  // that it may take, above 0; absent: as long as it takes
  bool anew = false;              // takes nothing from the last table in the directory
  int rounds = 3;  // each variant is measured so often, with other random numbers each time
  render::DeviceOptions device;
  bool terminal = false;  // `out` is a terminal: progress is one rewritten line
  std::stop_token stop;   // ends with what is known by then
};

}  // namespace previz::trade
