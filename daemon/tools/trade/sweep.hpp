// The sweep of `previz trade`: the reference, every method in every round, the pictures at the
// corners, and then the answers.
#pragma once

#include <functional>
#include <iosfwd>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/output/progress.hpp"
#include "daemon/core/render/renderer.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/timing/frame.hpp"
#include "daemon/tools/trade/budget.hpp"
#include "daemon/tools/trade/cache.hpp"
#include "daemon/tools/trade/measure.hpp"
#include "daemon/tools/trade/method.hpp"
#include "daemon/tools/trade/options.hpp"
#include "daemon/tools/trade/probes.hpp"
#include "daemon/tools/trade/report.hpp"

namespace previz::trade {

class Sweep {
 public:
  // Goes on from `memory`, which outlives the sweep, and adds what it measures.
  Sweep(const TradeOptions& options, timing::TimedFrame& frame, const scene::Scene& scene,
        std::shared_ptr<render::Device> device, TradeCache& cache);
  // Calls `save` with what is known, whenever that grows. Ends early, with that, if it is to stop.
  TradeReport run(std::ostream& out, const std::function<void(const TradeReport&)>& save);

 private:
  MethodRenderer renderer_of(std::size_t method) const {
    return {device_, frame_, scene_, report_.plan.methods[method].settings, options_.scale};
  }
  // In one round all methods use the same seed, so that they differ by their settings alone.
  std::uint32_t seed(int round) const {
    return report_.plan.methods.front().settings.estimation.seed + 1 +
           static_cast<std::uint32_t>(round);
  }
  void plan();
  // The first half of the reference, when it had so many samples.
  struct OnTheWay {
    int samples;
    TradePicture noisy, denoised;
  };
  void make_reference();
  TradePicture picture_of(const render::Layers& layers) const;
  bool is_enough(const KeptReference& reference) const;
  void use_reference();
  StillCurves curves_of(const std::vector<OnTheWay>& seen) const;
  void sweep(const std::function<void(const TradeReport&)>& save);
  bool has_time_for_a_method() const;
  [[noreturn]] void refuse_short_reference(int samples, double began_s) const;
  void worked(const std::string& step, double work);
  KeptPoint& kept(std::size_t method, std::size_t point);
  int rounds_of(std::size_t method);
  void measure(std::size_t method, int round);
  std::pair<std::vector<TradePicture>, std::vector<TradePicture>> alike(std::size_t method) const;
  void compare_parts(std::size_t method, const render::Layers& layers);
  void conclude();
  void find_corners();
  TradeCorner corner(const std::string& name, const TradeFrontPoint& at) const;
  Plate displayed(const TradePicture& picture) const;
  void find_answers();
  double gain(const timing::FrameSettings& settings, bool is_live) const;
  Rehearsal rehearsal_of(const set::Set& set);
  void stop_if_asked() const {
    if (options_.stop.stop_requested()) throw Stopped();
  }

  const TradeOptions& options_;
  timing::TimedFrame& frame_;
  const scene::Scene& scene_;
  const std::shared_ptr<render::Device> device_;
  TradeReport report_;
  std::optional<TradeReference> reference_;
  TradeCache& cache_;
  std::vector<std::map<int, TradePicture>> best_;  // by method and round: at the most samples
  render::Layers own_;  // the set's own in the first round, at the most samples; empty: not yet

  std::uint32_t needed_ = 0;  // as searched_axes() wants it

  TradeBudget budget_;
  Probes probes_;
  std::optional<output::ShareProgress> progress_;
  const double start_s_;
  double last_s_;             // when progress was shown last
  double of_a_method_s_ = 0;  // the longest measurement of a method so far
};

}  // namespace previz::trade
