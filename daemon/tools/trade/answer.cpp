#include "daemon/tools/trade/answer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "daemon/core/output/chart.hpp"
#include "daemon/core/pipeline/governor.hpp"
#include "daemon/core/set/print.hpp"

namespace previz::trade {
namespace {

using output::samples_words, output::share_words, output::time_words;

constexpr double never = std::numeric_limits<double>::infinity();
// A change is kept only if it brings more than the error's own uncertainty in a few rounds.
constexpr double worth_keeping = 0.97;
constexpr std::array scales = {1.0, 0.7071, 0.5, 0.3536, 0.25};
constexpr std::array step_samples = {1, 2, 4, 8, 16};
constexpr std::size_t most_steps = 8;
// A variant that brought less than this alone is not tried together with others.
constexpr double hopeless_gain = 0.8;
// A rehearsal that takes this much longer than frames alone asks for another plan.
constexpr double worth_planning_anew = 1.25;
// A rate counts as held if so much of it is shown.
constexpr double rate_tolerance = 0.95;
constexpr int most_offline = 1 << 16;

const std::array searched = {"estimator",  "difference_sampling", "depth",           "caustics",
                             "light_mode", "light_sampling",      "light_resolution"};

// One way to make a frame, and what it is worth for a use: less is better.
struct Found {
  timing::FrameSettings settings;
  timing::Making making = {};
  double seconds = never;
  SquaredError squared = {};
  double worth = never;
  bool is_whole = true;
};

using Judge = std::function<Found(const timing::FrameSettings&)>;

struct Candidate {
  const TradeAxis* axis;
  const TradeVariant* variant;
  double gain;
};

// Returns the variants that are worth a try, the most promising first, without those that were
// clearly worse alone.
std::vector<Candidate> candidates(const timing::FrameSettings& own,
                                  const std::vector<TradeAxis>& axes, const TradeProbe& probe,
                                  bool is_live) {
  std::vector<Candidate> found;
  for (const TradeAxis& axis : axes)
    for (const TradeVariant& variant : axis.variants) {
      timing::FrameSettings settings = own;
      variant.change(settings);
      if (settings == own) continue;
      const double gain = probe.gain(settings, is_live);
      if (gain >= hopeless_gain) found.push_back({&axis, &variant, gain});
    }
  std::ranges::stable_sort(found, std::greater(), &Candidate::gain);
  return found;
}

// Goes along the candidates until a round changes nothing, at most twice.
void descend_from(Found& best, const std::vector<Candidate>& candidates, const Judge& judge,
                  const TradeProbe& probe, const std::string& use) {
  for (int round = 0; round < 2; ++round) {
    bool is_better = false;
    for (const Candidate& candidate : candidates) {
      timing::FrameSettings settings = best.settings;
      candidate.variant->change(settings);
      if (settings == best.settings) continue;
      probe.step(use + ": " + candidate.axis->name + " " + candidate.variant->name);
      Found found = judge(settings);
      if (!(found.worth < worth_keeping * best.worth)) continue;
      best = std::move(found);
      is_better = true;
    }
    if (!is_better) break;
  }
}

// The settings at the start are judged whatever the time; from there on it goes as far as that
// reaches.
Found descend(const timing::FrameSettings& start, const std::vector<Candidate>& candidates,
              const Judge& judge, const TradeProbe& probe, const std::string& use,
              TradePhase phase) {
  probe.limit(std::nullopt);
  probe.step(use + ": where the search begins");
  Found best = judge(start);
  probe.limit(phase);
  try {
    descend_from(best, candidates, judge, probe, use);
  } catch (const OutOfTime&) {
    best.is_whole = false;
  }
  probe.limit(std::nullopt);
  return best;
}

// The least error among what holds the rate. Where nothing does, the time of the fastest counts,
// far behind any error.
Found judge_live(const timing::FrameSettings& settings, double planned_s, const TradeProbe& probe) {
  constexpr double behind = 1e6;
  const timing::PathCost cost = probe.cost(settings, true);
  Found best{settings};
  for (const double scale : scales)
    for (const bool denoise : {true, false}) {
      timing::Making making{1, scale, denoise};
      const int samples = cost.samples_within(planned_s, making);
      making.samples = std::max(samples, 1);
      const double seconds = cost.seconds(making);
      const SquaredError squared =
          samples > 0 ? probe.error(settings, making, false) : SquaredError{never, 0};
      const double worth = samples > 0 ? error_of(squared) : behind * seconds;
      if (worth < best.worth) best = {settings, making, seconds, squared, worth};
    }
  return best;
}

// The least time in which the error is reached, at full size.
Found judge_still(const timing::FrameSettings& settings, bool is_own, double wanted,
                  const TradeProbe& probe) {
  constexpr double behind = 1e6;
  const timing::PathCost cost = probe.cost(settings, false);
  const StillCurves curves = probe.curves(settings, wanted);
  Found best{settings};
  for (const bool denoise : {true, false}) {
    const ErrorCurve& curve = denoise ? curves.denoised : curves.noisy;
    // The reference, to which the set's own settings converge, is of the same.
    const bool is_unbiased = is_own && !denoise;
    timing::Making making{curve.samples_for(wanted, most_offline, is_unbiased), 1, denoise};
    const bool is_reached = making.samples > 0;
    if (!is_reached) making.samples = most_offline;
    const double seconds = cost.seconds(making);
    const SquaredError squared = curve.squared(making.samples, is_unbiased);
    const double worth = is_reached ? seconds : behind * seconds * error_of(squared);
    if (worth < best.worth) best = {settings, making, seconds, squared, worth};
  }
  return best;
}

// `slower` is how much longer frames take in the rehearsal than alone.
std::vector<TradeStep> steps_of(const timing::FrameSettings& settings, double slowest_s,
                                double slower, const TradeProbe& probe) {
  const timing::PathCost cost = probe.cost(settings, true);
  std::vector<TradeStep> all;
  probe.limit(TradePhase::live_steps);
  try {
    // First what is fastest: a preview that cannot go below its rate's step falls behind.
    for (const int samples : step_samples)
      for (const double scale : scales)
        for (const bool denoise : {true, false}) {
          const timing::Making making{samples, scale, denoise};
          const double seconds = slower * cost.seconds(making);
          // Far above what a preview may take.
          if (seconds > slowest_s) continue;
          all.push_back({making, seconds, error_of(probe.error(settings, making, false))});
        }
  } catch (const OutOfTime&) {
    // Steps of few samples are there, which is what live needs.
  }
  probe.limit(std::nullopt);
  return best_steps(std::move(all));
}

set::Set with(set::Set set, const timing::FrameSettings& settings) {
  const std::uint32_t seed = set.estimation.seed;
  set.estimation = settings.estimation;
  set.estimation.seed = seed;
  set.lighting = settings.lighting;
  return set;
}

std::string unfinished_words(const Found& found) {
  return found.is_whole ? "" : "; there was no time to try all settings";
}

std::string error_words(const TradeAnswer& answer) {
  const std::string words = share_words(answer.error);
  return answer.error_deviation > 0
             ? words + " (give or take " + share_words(answer.error_deviation) + ")"
             : words;
}

std::string making_words(const timing::Making& making) {
  return fmt::format("{} at {:.0f} % of the size{}", samples_words(making.samples),
                     100 * making.scale, making.denoise ? ", denoised" : "");
}

std::string live_words(const TradeQuestion& question, const TradeAnswer& answer, double take_fps) {
  if (!answer.is_met)
    return fmt::format(
        "{:g} frames per second is more than this machine can do{}: {:.2g} at most, with {}, error "
        "{}",
        question.fps, answer.shown_fps > 0 ? " beside tracking and lighting" : "",
        answer.shown_fps > 0 ? std::min(answer.shown_fps, 1 / answer.seconds) : 1 / answer.seconds,
        making_words(answer.making), error_words(answer));
  std::string words = fmt::format("{:g} frames per second with {}, error {}", question.fps,
                                  making_words(answer.making), error_words(answer));
  if (answer.shown_fps == 0)
    return words + (answer.not_rehearsed.empty()
                        ? "; there was no time to rehearse it beside tracking and lighting"
                        : "; its rehearsal failed: " + answer.not_rehearsed);
  if (take_fps < rate_tolerance * question.fps)
    words += fmt::format("; rehearsed at the take's {:.3g} per second", take_fps);
  return words;
}

// Settings, and the steps of the preview, for the time that a frame may take.
struct LivePlan {
  Found found;
  set::Set set;
};

class LiveSearch {
 public:
  LiveSearch(const TradeQuestion& question, const set::Set& set, const timing::FrameSettings& own,
             const std::vector<TradeAxis>& axes, const TradeProbe& probe)
      : question_(question),
        set_(set),
        own_(own),
        candidates_(candidates(own, axes, probe, true)),
        probe_(probe) {}

  // What runs beside the renderer takes time from it where they share a processor. By how much is
  // seen in a rehearsal; other settings may then be the best.
  TradeAnswer answer() const {
    LivePlan plan = planned(own_, 1);
    TradeAnswer answer = rehearsed(plan);
    const double slower =
        answer.seconds / probe_.cost(plan.found.settings, true).seconds(answer.making);
    if (answer.shown_fps > 0 && slower > worth_planning_anew) {
      const LivePlan other = planned(plan.found.settings, slower);
      const TradeAnswer again = rehearsed(other);
      if (again.shown_fps > 0 && is_better(again, answer)) {
        plan = other;
        answer = again;
      }
    }
    answer.is_whole = plan.found.is_whole;
    answer.toml = set::overlay_toml(set_, plan.set);
    answer.words = live_words(question_, answer, probe_.take_fps) + unfinished_words(plan.found);
    return answer;
  }

 private:
  LivePlan planned(const timing::FrameSettings& start, double slower) const {
    const double frame_s = 1 / question_.fps;
    const double planned_s = pipeline::Governor::headroom * frame_s / slower;
    const Found found = descend(
        start, candidates_,
        [&](const timing::FrameSettings& s) { return judge_live(s, planned_s, probe_); }, probe_,
        "live", TradePhase::live);
    LivePlan plan{found, with(set_, found.settings)};
    set::Quality& quality = plan.set.quality;
    quality.fps = question_.fps;
    probe_.step("live: the steps of the preview");
    for (const TradeStep& step : steps_of(found.settings, 4 * frame_s, slower, probe_))
      quality.steps.push_back({step.making.samples, step.making.scale, step.making.denoise});
    if (quality.steps.empty())
      quality.steps.push_back({1, found.making.scale, found.making.denoise});
    return plan;
  }

  static bool is_better(const TradeAnswer& a, const TradeAnswer& b) {
    if (a.is_met != b.is_met) return a.is_met;
    return a.is_met ? a.error < b.error : a.seconds < b.seconds;
  }

  TradeAnswer rehearsed(const LivePlan& plan) const {
    TradeAnswer answer{.use = "live", .settings = plan.found.settings, .making = plan.found.making};
    answer.seconds = plan.found.seconds;
    probe_.step("live: rehearsal of the take");
    const Rehearsal rehearsal = probe_.rehearse(plan.set);
    answer.not_rehearsed = rehearsal.why_not;
    if (rehearsal.fps > 0) {
      answer.making = rehearsal.making;
      answer.seconds = rehearsal.frame_s;
      answer.shown_fps = rehearsal.fps;
    }
    const double wanted_fps = std::min(question_.fps, probe_.take_fps);
    answer.is_met = answer.seconds * question_.fps <= 1 &&
                    (answer.shown_fps == 0 || answer.shown_fps >= rate_tolerance * wanted_fps);
    probe_.limit(TradePhase::live_rehearsal);
    const SquaredError squared = stated_error(answer, plan.found);
    probe_.limit(std::nullopt);
    answer.error = error_of(squared);
    answer.error_deviation = deviation_of(squared);
    return answer;
  }

  SquaredError stated_error(const TradeAnswer& answer, const Found& found) const {
    try {
      return probe_.error(answer.settings, answer.making, true);
    } catch (const OutOfTime&) {
      return answer.making == found.making ? found.squared : SquaredError{never, 0};
    }
  }

  const TradeQuestion& question_;
  const set::Set& set_;
  const timing::FrameSettings& own_;
  const std::vector<Candidate> candidates_;
  const TradeProbe& probe_;
};

TradeAnswer answer_still(const std::string& use, const TradeQuestion& question, const set::Set& set,
                         const Found& found) {
  TradeAnswer answer{.use = use, .settings = found.settings, .making = found.making};
  answer.seconds = found.seconds;
  answer.error = error_of(found.squared);
  answer.error_deviation = deviation_of(found.squared);
  answer.is_met = answer.error <= question.error * (1 + 1e-9);
  answer.is_whole = found.is_whole;
  set::Set wanted = with(set, found.settings);
  wanted.quality.steps.clear();
  wanted.quality.denoise = found.making.denoise;
  wanted.quality.samples = found.making.samples;
  answer.toml = set::overlay_toml(set, wanted);
  answer.words = answer.is_met
                     ? fmt::format("error {} after {}, with {}{}", error_words(answer),
                                   time_words(found.seconds), samples_words(found.making.samples),
                                   found.making.denoise ? ", denoised" : "")
                     : fmt::format("an error of {} is not reached{}", share_words(question.error),
                                   std::isfinite(answer.error)
                                       ? "; " + error_words(answer) + " is the lowest expected"
                                       : "");
  answer.words += unfinished_words(found);
  return answer;
}

}  // namespace

std::vector<TradeAxis> searched_axes(const timing::FrameSettings& own, std::uint32_t needed) {
  std::vector<TradeAxis> axes = trade_axes(own, needed);
  std::erase_if(axes, [](const TradeAxis& axis) {
    return std::ranges::find(searched, axis.name) == searched.end();
  });
  return axes;
}

std::vector<TradeStep> best_steps(std::vector<TradeStep> all) {
  std::ranges::stable_sort(all, {}, &TradeStep::error);
  std::vector<TradeStep> best;
  for (const TradeStep& step : all) {
    if (!best.empty() && step.seconds > worth_keeping * best.back().seconds) continue;
    best.push_back(step);
  }
  // Of too many, those are dropped that are nearest in time to the one before.
  while (best.size() > most_steps) {
    std::size_t nearest = 1;
    const auto ratio = [&](std::size_t i) { return best[i].seconds / best[i - 1].seconds; };
    for (std::size_t i = 2; i + 1 < best.size(); ++i)
      if (ratio(i) > ratio(nearest)) nearest = i;
    best.erase(best.begin() + static_cast<std::ptrdiff_t>(nearest));
  }
  return best;
}

std::vector<TradeAnswer> answer(const TradeQuestion& question, const set::Set& set,
                                const timing::FrameSettings& own,
                                const std::vector<TradeAxis>& axes, const TradeProbe& probe) {
  TradeAnswer live = LiveSearch(question, set, own, axes, probe).answer();
  // A refinement keeps the layers, as a render does, and so finds its settings in the same way.
  const Found still = descend(
      own, candidates(own, axes, probe, false),
      [&](const timing::FrameSettings& s) {
        return judge_still(s, s == own, question.error, probe);
      },
      probe, "refine and post", TradePhase::still);
  return {std::move(live), answer_still("refine", question, set, still),
          answer_still("post", question, set, still)};
}

}  // namespace previz::trade
