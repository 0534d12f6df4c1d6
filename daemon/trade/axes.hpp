// The table of axes that `previzd trade` sweeps. Each axis is a list of variants of the set's own
// settings.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "daemon/set/set.hpp"

namespace previz::trade {

// Everything that a variant may change.
struct TradeSettings {
  set::Estimation estimation;
  set::Lighting lighting;
  std::optional<ThinLens> lens;
  bool adaptive = false;      // quality.adaptive
  bool denoise = false;       // quality.denoise
  double scale = 1;           // of the sweep's own picture size
  std::uint32_t carried = 0;  // FEATURE_* bits of features that the frame does not need

  friend bool operator==(const TradeSettings&, const TradeSettings&) = default;
};

struct TradeVariant {
  std::string name;
  std::function<void(TradeSettings&)> change;
};

struct TradeAxis {
  std::string name;  // in the CSV
  std::string what;  // what is traded, in words for people
  std::vector<TradeVariant> variants;
  std::string own;  // name of the set's own variant if it is not in the list
};

// Returns the axes that have something to trade on this set. `needed` holds the FEATURE_* bits that
// its pipelines are made with, and FEATURE_PHOTONS if photons would find something, whatever the
// set's caustics are: without a mirror or clear glass in the light they have no axis, and without
// an object that is virtual or removed nothing is aimed at one.
std::vector<TradeAxis> trade_axes(const TradeSettings& own, std::uint32_t needed);

// Returns the names of all axes, as --axes takes them.
std::vector<std::string> axis_names();

// The name of the axis whose variants carry features that are not needed. They must show the set's
// own picture, bit for bit.
inline constexpr const char* parts_axis = "parts";

// The settings to measure. Each method is listed once, even if it is on several axes; the first is
// the set's own settings.
struct TradePlan {
  struct Entry {
    std::string variant;
    std::size_t method;  // index into methods
  };
  struct Axis {
    std::string name, what;
    std::vector<Entry> entries;
  };
  struct Method {
    std::string name;  // "estimator difference"; for people
    TradeSettings settings;
  };
  std::vector<Method> methods;
  std::vector<Axis> axes;  // on each are the set's own settings and at least one more
};
// Plans the sweep over the axes named in `wanted`, or all if it is empty. Throws previz::Error
// naming an axis that does not exist.
TradePlan plan_trade(const TradeSettings& own, std::vector<TradeAxis> axes,
                     const std::vector<std::string>& wanted = {});

}  // namespace previz::trade
