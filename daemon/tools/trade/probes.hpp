// Measures what the search for answers asks for, and remembers it.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>

#include "daemon/core/render/renderer.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/timing/frame.hpp"
#include "daemon/tools/trade/answer.hpp"
#include "daemon/tools/trade/budget.hpp"
#include "daemon/tools/trade/cache.hpp"
#include "daemon/tools/trade/measure.hpp"
#include "daemon/tools/trade/method.hpp"

namespace previz::trade {

// The sweep was told to stop.
struct Stopped {};

class Probes {
 public:
  struct Parts {  // references outlive the probes
    std::shared_ptr<render::Device> device;
    timing::TimedFrame& frame;
    const scene::Scene& scene;
    const TradeBudget& budget;
    double scale;         // of the sweep, relative to the observer's size
    int rounds;           // of an error that is stated
    double live_limit_s;  // a frame of the whole size that takes longer is of no use live
    std::function<std::uint32_t(int round)> seed;
    std::function<double()> now_s;
    std::stop_token stop;
  };
  // What is measured goes into `memory`, and what is there is not measured again.
  Probes(Parts parts, timing::FrameSettings own, TradeCache& cache)
      : parts_(std::move(parts)), own_(std::move(own)), cache_(cache) {}

  // Everything below compares with it.
  void use(const TradeReference& reference) { reference_ = &reference; }
  const TradeReference& reference() const { return *reference_; }
  // All throw Stopped, and OutOfTime if the phase that limit() was told is over and what is asked
  // for is not known.
  void limit(std::optional<TradePhase> phase) { phase_ = phase; }
  // The square of the error of a picture of this making, its scale relative to the sweep's size: of
  // one round, or the mean of all with `stated`.
  SquaredError error(const timing::FrameSettings& settings, const timing::Making& making,
                     bool stated);
  // How the error falls with the samples, noisy and denoised, until it is at most `wanted`. What
  // the phase has no time for follows from the set's own settings.
  StillCurves curves(const timing::FrameSettings& settings, double wanted);
  timing::PathCost cost(const timing::FrameSettings& settings, bool is_live);

 private:
  std::string words(const timing::FrameSettings& settings) const {
    return settings_words(parts_.frame.set(), settings);
  }
  SquaredError measure(const timing::FrameSettings& settings, int samples, int round);
  StillCurves measure_curves(const timing::FrameSettings& settings, double wanted);
  bool is_over() const;
  void stop_if_over() const;

  Parts parts_;
  const timing::FrameSettings own_;
  const TradeReference* reference_ = nullptr;
  TradeCache& cache_;
  std::optional<MethodRenderer> probing_;  // with these settings
  timing::FrameSettings probed_;
  std::optional<TradePhase> phase_;
};

}  // namespace previz::trade
