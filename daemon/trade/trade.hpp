// Measures what render time buys on a set, as `previzd trade` does: one frame of its take is
// rendered with every variant of every axis (axes.hpp) and compared with a long reference made with
// the set's own settings.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/render/renderer.hpp"
#include "daemon/trade/frame.hpp"
#include "daemon/trade/report.hpp"

namespace previz::trade {

// Reads "2%" or "0.02"; throws previz::Error saying what is allowed.
double parse_share(const std::string& text);

struct TradeOptions {
  TradeSource source;
  // The rate and the error that are asked for; absent: quality.fps, or 25, and 2 %.
  std::optional<double> fps, error;
  bool answers = false;                            // search the settings for them
  std::optional<std::uint64_t> frame;              // absent: the first with a pose and light
  std::optional<std::filesystem::path> directory;  // absent: trade/ in the set's output directory
  double scale = 0.25;                             // of the observer's size, above 0 and at most 1
  std::vector<std::string> axes;                   // by name; empty: all
  std::vector<int> samples = {1, 2, 4, 8, 16};     // per pixel
  // Samples of both halves together; absent: 256 times the largest of `samples`, so that the
  // reference's error is about a sixteenth of the set's own best.
  std::optional<int> reference_samples;
  std::optional<double> minutes;  // that it may take, above 0; absent: as long as it takes
  bool anew = false;              // takes nothing from the last table in the directory
  int rounds = 3;  // each variant is measured so often, with other random numbers each time
  render::DeviceOptions device;
  bool terminal = false;  // `out` is a terminal: progress is one rewritten line
  std::stop_token stop;   // ends with what is known by then
};

// Writes DIR/trade.csv and DIR/trade.html (page.hpp), and, with answers, DIR/live.toml, refine.toml
// and post.toml, which `previzd run` and `previzd render` take with --with, of those answers that
// hold what was asked for. Table and page are written after every round, so that they are there
// whenever it ends; beside them trade.json and reference.bin keep what was measured for the next
// time (memory.hpp); what was not measured in the time is named on the page. Progress and notes go
// to `out`. Throws previz::Error for a set without a take (TradeSource), a frame that is missing or
// was not tracked, an impossible scale, a directory that is a file, or a picture with nothing
// virtual in it.
TradeReport run_trade(const TradeOptions& options, std::ostream& out);

}  // namespace previz::trade
