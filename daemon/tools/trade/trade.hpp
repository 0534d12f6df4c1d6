// Measures what render time buys on a set, as `previz trade` does: one frame of its take is
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

#include "daemon/core/render/renderer.hpp"
#include "daemon/core/timing/frame.hpp"
#include "daemon/tools/trade/options.hpp"
#include "daemon/tools/trade/report.hpp"

namespace previz::trade {

// Reads "2%" or "0.02"; throws previz::Error saying what is allowed.
double parse_share(const std::string& text);

// Writes DIR/trade.csv and DIR/trade.html (page.hpp), and, with answers, DIR/live.toml, refine.toml
// and post.toml, which `previzd run` and `previz render` take with --with, of those answers that
// hold what was asked for. Table and page are written after every round, so that they are there
// whenever it ends; beside them trade.json and reference.bin keep what was measured for the next
// time (memory.hpp); what was not measured in the time is named on the page. Progress and notes go
// to `out`. Throws previz::Error for a set without a take (timing::FrameSource), a frame that is
// missing or was not tracked, an impossible scale, a directory that is a file, or a picture with
// nothing virtual in it.
TradeReport run_trade(const TradeOptions& options, std::ostream& out);

}  // namespace previz::trade
