// The table of axes that `previz trade` sweeps. Each axis is a list of variants of the set's own
// settings.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/timing/frame.hpp"

namespace previz::trade {

struct TradeVariant {
  std::string name;
  std::function<void(timing::FrameSettings&)> change;
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
std::vector<TradeAxis> trade_axes(const timing::FrameSettings& own, std::uint32_t needed);

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
    timing::FrameSettings settings;
  };
  std::vector<Method> methods;
  std::vector<Axis> axes;  // on each are the set's own settings and at least one more
};
// Plans the sweep over the axes named in `wanted`, or all if it is empty. Throws previz::Error
// naming an axis that does not exist.
TradePlan plan_trade(const timing::FrameSettings& own, std::vector<TradeAxis> axes,
                     const std::vector<std::string>& wanted = {});

}  // namespace previz::trade
