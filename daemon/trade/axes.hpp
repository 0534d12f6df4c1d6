// What `previzd trade` sweeps: one table of axes, each a list of variants of the set's own
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
  std::string what;  // for people: what is traded
  std::vector<TradeVariant> variants;
  std::string own;  // how the set's own variant is called where it is none of the list
};

// The axes that have something to trade on this set. `needed`: the FEATURE_* bits that its
// pipelines are made with.
std::vector<TradeAxis> trade_axes(const TradeSettings& own, std::uint32_t needed);

// The name of the axis of features that are not needed but carried: its variants must show the
// set's own picture, bit for bit.
inline constexpr const char* parts_axis = "parts";

// Different settings to measure, each once, however many axes they are on; the first are the set's
// own.
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
// `wanted`: names of axes; empty: all. Throws previz::Error naming one that is not there.
TradePlan plan_trade(const TradeSettings& own, std::vector<TradeAxis> axes,
                     const std::vector<std::string>& wanted = {});

}  // namespace previz::trade
