// What `previzd trade` measured: every method at every number of samples, and the front of them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/trade/axes.hpp"
#include "daemon/trade/measure.hpp"
#include "drivers/frame.hpp"

namespace previz::trade {

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
// The points of the front that are worth a line: each is nearer than the one before by a tenth of
// its error at least; the first and the last of the front, and the corners, always are.
std::vector<TradeFrontPoint> listed_front_of(const TradeReport& report);

}  // namespace previz::trade
