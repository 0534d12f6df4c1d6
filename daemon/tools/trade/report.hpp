// The measurements of `previz trade`: every method at every number of samples, and their Pareto
// front.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/tools/trade/answer.hpp"
#include "daemon/tools/trade/axes.hpp"
#include "daemon/tools/trade/measure.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::trade {

// A method at one number of samples, over all rounds.
struct TradePoint {
  int samples = 0;
  double seconds = 0;  // rendering alone, after a warm-up; the median of the rounds
  TradeErrors errors;
  std::string within_noise;  // errors for which the reference is too noisy
  bool pareto = false;       // by seconds and errors.picture
};

struct TradeMethod {
  std::string name;
  std::vector<TradePoint> points;            // in order of samples; none: it was not measured
  std::optional<TradeReference::Bias> bias;  // absent: fewer than three rounds
  // For methods that carry unneeded features: the number of pixels that differ from the set's own
  // picture, which must be 0.
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
  TradeQuestion question;
  std::vector<TradeAnswer> answers;     // empty: none was asked for
  std::filesystem::path csv, page;      // as written
  bool interrupted = false;             // by a signal; what was known by then is there
  std::vector<std::string> unmeasured;  // methods that there was no time for

  const TradePoint& point(const TradeFrontPoint& at) const {
    return methods[at.method].points[at.point];
  }
};

// Returns the points on the front, in order of time.
std::vector<TradeFrontPoint> front_of(const TradeReport& report);
// Returns the points of the front that are worth a line: each reduces the error of the one before
// by at least a tenth. The first, the last and the corners are always included.
std::vector<TradeFrontPoint> listed_front_of(const TradeReport& report);

}  // namespace previz::trade
