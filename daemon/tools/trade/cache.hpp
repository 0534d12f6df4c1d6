// Keeps what a trade has measured beside its table, so that the next one of the same frame with the
// same set goes on from there.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/render/device/gpu.hpp"
#include "daemon/core/render/picture/layers.hpp"
#include "daemon/core/timing/frame.hpp"
#include "daemon/core/timing/path_timer.hpp"
#include "daemon/tools/trade/answer.hpp"
#include "daemon/tools/trade/axes.hpp"
#include "daemon/tools/trade/measure.hpp"

namespace previz::trade {

// The measurements with some settings and one number of samples, with an entry a round in each.
struct KeptPoint {
  std::string settings;  // settings_words()
  int samples = 0;
  std::vector<SquaredError> squared;
  std::vector<TradeErrors> errors;  // with the noise of the reference of the time
  std::vector<double> seconds;
};

struct KeptMethod {
  std::string settings;
  std::optional<TradeReference::Bias> bias;
  std::optional<std::size_t> changed_pixels;
};

struct KeptCost {
  std::string settings;
  bool is_live = false;
  timing::PathCost cost;
};

struct KeptCurves {
  std::string settings;
  StillCurves curves;  // as measured
};

// The two halves of a reference: of their layers, composite and mask.
struct KeptReference {
  int samples = 0;  // of each half; 0: there is none
  std::array<render::Layers, 2> halves;
  StillCurves curves;  // of the set's own settings

  // Adds samples that were rendered by themselves, with random numbers of their own.
  void add(int more, const std::array<const render::Layers*, 2>& layers);
};

struct TradeCache {
  KeptReference reference;
  TradeErrors noise;  // of the reference, to which the errors of the points belong
  std::vector<KeptPoint> points;
  std::vector<KeptMethod> methods;
  std::vector<KeptCost> costs;
  std::vector<KeptCurves> curves;

  KeptPoint& point(const std::string& settings, int samples);  // an empty one if there is none
  // Returns null if there is none.
  const KeptMethod* method(const std::string& settings) const;
  // Makes errors those from a reference of this noise, and noise that one's.
  void change_noise(const TradeErrors& to);
};

// Returns text that is the same for the same settings on one set, and only for these.
std::string settings_words(const set::Set& set, const timing::FrameSettings& settings);

// Returns a text that is the same only for what gives the same pictures in the same time: program,
// device, scale, set, what its files hold, and the frame with its pose and its light. Throws
// previz::Error for a file that cannot be read.
std::string memory_key(timing::TimedFrame& frame, const scene::Scene& scene, double scale,
                       const render::DeviceFacts& device);

// Returns what is kept in the directory under this key; nothing if it holds none, or of another
// key. What cannot be read is said in `why_not`.
TradeCache load_cache(const std::filesystem::path& directory, const std::string& key,
                      std::string& why_not);
// Throws previz::Error.
void save_cache(const std::filesystem::path& directory, const std::string& key,
                const TradeCache& cache);

}  // namespace previz::trade
