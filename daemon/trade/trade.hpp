// `previzd trade`: what time buys on a set. One frame of its take is rendered with every variant of
// every axis (axes.hpp) and compared with a long reference made with the set's own settings.
#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/render/renderer.hpp"
#include "daemon/trade/axes.hpp"
#include "daemon/trade/measure.hpp"
#include "drivers/frame.hpp"

namespace previz::trade {

struct TradeOptions {
  std::filesystem::path set_file;
  std::optional<std::uint64_t> frame;  // of the observer; the first with a pose and light
  std::optional<std::filesystem::path> directory;  // the set's output directory, /trade below it
  double scale = 0.25;                             // of the observer's size, above 0 and at most 1
  std::vector<std::string> axes;                   // by name; empty: all
  std::vector<int> samples = {1, 2, 4, 8, 16};     // per pixel
  // Of both halves together; absent: 256 times the most of `samples`, so that the reference's error
  // is about a sixteenth of the set's own best.
  std::optional<int> reference_samples;
  int rounds = 3;  // each variant is measured so often, with other random numbers each time
  render::DeviceOptions device;
  bool terminal = false;  // progress goes to a terminal: a line that is rewritten
  std::stop_token stop;   // ends without a result
};

// A method at one number of samples, over all rounds.
struct TradePoint {
  int samples = 0;
  double seconds = 0;  // rendering alone, after a warm-up; the median of the rounds
  TradeErrors errors;
  std::string within_noise;  // the errors that the reference is too noisy to tell
  bool pareto = false;       // by seconds and errors.picture
};

struct TradeMethod {
  std::string name;
  std::vector<TradePoint> points;            // in order of samples
  std::optional<TradeReference::Bias> bias;  // absent: fewer than three rounds
  // Parts carried along: pixels that differ from the set's own picture; must be 0.
  std::optional<std::size_t> changed_pixels;
};

// Indices into TradeReport::methods and its points.
struct TradeFrontPoint {
  std::size_t method = 0, point = 0;

  friend bool operator==(const TradeFrontPoint&, const TradeFrontPoint&) = default;
};

// A point of the front with its pictures, as a display would show them, 8 bit.
struct TradeCorner {
  std::string name;  // "fastest", "knee", "best"
  TradeFrontPoint at;
  Plate picture;
  Plate difference;  // 128 + 5 (picture - reference)
};

struct TradeReport {
  std::string set, device;
  std::uint64_t frame = 0;
  int width = 0, height = 0;            // of the sweep
  int full_width = 0, full_height = 0;  // of the observer
  int rounds = 0, reference_samples = 0;
  TradeErrors noise;  // the reference's own
  TradePlan plan;
  std::vector<TradeMethod> methods;  // as plan.methods
  std::vector<TradeCorner> corners;
  Plate reference;
  std::filesystem::path csv, page;  // as written
  bool interrupted = false;         // then nothing was written

  const TradePoint& point(const TradeFrontPoint& at) const {
    return methods[at.method].points[at.point];
  }
};

// The points on the front, in order of time.
std::vector<TradeFrontPoint> front_of(const TradeReport& report);
// Those worth telling people of: each is nearer than the one before by a tenth of its error at
// least; the first and the last of the front, and the corners, always are.
std::vector<TradeFrontPoint> told_front_of(const TradeReport& report);

// Writes DIR/trade.csv and DIR/trade.html (page.hpp). Progress and notes go to `out`. Throws
// previz::Error: a set without a replayed observer, a frame that is not there or was not tracked,
// an impossible scale, a directory that is a file, nothing virtual in the picture.
TradeReport run_trade(const TradeOptions& options, std::ostream& out);

}  // namespace previz::trade
