// Answers what a crew asks of the trade: which settings hold a frame rate with the least error, and
// which reach an error in the least time. Combinations are searched from the set's own settings on:
// first what brought most by itself, each time keeping what was found (greedy coordinate descent).
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/timing/frame.hpp"
#include "daemon/core/timing/path_timer.hpp"
#include "daemon/tools/trade/axes.hpp"
#include "daemon/tools/trade/budget.hpp"
#include "daemon/tools/trade/curve.hpp"
#include "daemon/tools/trade/measure.hpp"
#include "daemon/tools/trade/rehearsal.hpp"

namespace previz::trade {

struct TradeQuestion {
  double fps = 25;      // that live is to hold, above 0
  double error = 0.02;  // that refining and rendering are to reach, of the picture, above 0
};

// One of the three ways to use a set, with the settings that suit it.
struct TradeAnswer {
  std::string use;  // "live", "refine", "post"
  timing::FrameSettings settings;
  timing::Making making;  // live: the step that holds the rate
  double seconds = 0;     // a frame, at full size
  // Of the picture, as measured at the sweep's size, and the standard deviation of that.
  double error = 0, error_deviation = 0;
  double shown_fps = 0;  // live: the pictures a second of the rehearsal; 0: it showed none
  std::string not_rehearsed = {};  // live: why the rehearsal showed nothing; empty: no time
  bool is_met = false;
  bool is_whole = true;             // all settings were tried; otherwise time ran out
  std::string toml = {};            // set::overlay_toml()
  std::string words = {};           // what it comes to, in a sentence
  std::filesystem::path file = {};  // as written; empty where it is not met
};

struct StillCurves {
  ErrorCurve noisy, denoised;
};

// The measurements that the search asks for.
struct TradeProbe {
  // The square of the error of the picture, made with the settings in these samples at a scale
  // relative to the sweep's size; of all rounds if it is to be stated.
  std::function<SquaredError(const timing::FrameSettings&, const timing::Making&, bool stated)>
      error;
  std::function<StillCurves(const timing::FrameSettings&, double wanted)> curves;
  // What the settings are expected to bring: by how much the square of the error is smaller than
  // with the set's own settings in the same time, as measured alone; 1: nothing is known.
  std::function<double(const timing::FrameSettings&, bool is_live)> gain;
  std::function<timing::PathCost(const timing::FrameSettings&, bool is_live)> cost;
  std::function<Rehearsal(const set::Set&)> rehearse;
  double take_fps = 0;  // the most pictures a second that a rehearsal can show
  std::function<void(const std::string&)> step;  // called with what is searched next; may throw
  // From now on probes throw OutOfTime when that phase is over; nothing: they are made.
  std::function<void(std::optional<TradePhase>)> limit;
};

// The axes on which settings are searched: those of the estimator and of the light. What is a
// matter of the look or of the size is left as the set has it, or is a part of the preview's steps.
std::vector<TradeAxis> searched_axes(const timing::FrameSettings& own, std::uint32_t needed);

// Returns the steps of a preview (set::Quality::steps), best first: of all samples, sizes and with
// and without noise taken out, those to which no other is both cheaper and nearer to the truth.
struct TradeStep {
  timing::Making making;
  double seconds = 0, error = 0;
};
std::vector<TradeStep> best_steps(std::vector<TradeStep> all);

std::vector<TradeAnswer> answer(const TradeQuestion& question, const set::Set& set,
                                const timing::FrameSettings& own,
                                const std::vector<TradeAxis>& axes, const TradeProbe& probe);

}  // namespace previz::trade
