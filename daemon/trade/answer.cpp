#include "daemon/trade/answer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "daemon/pipeline/governor.hpp"
#include "daemon/set/print.hpp"
#include "daemon/trade/chart.hpp"

namespace previz::trade {
namespace {

constexpr double never = std::numeric_limits<double>::infinity();
// A change is kept only if it brings more than the error's own uncertainty in a few rounds.
constexpr double worth_keeping = 0.97;
constexpr std::array scales = {1.0, 0.7071, 0.5, 0.3536, 0.25};
constexpr std::array step_samples = {1, 2, 4, 8, 16};
constexpr std::size_t most_steps = 8;
constexpr int few = 4, many = 16;  // the samples from which the error of more is estimated
constexpr int most_offline = 1 << 16;

const std::array searched = {"estimator",  "difference_sampling", "depth",           "caustics",
                             "light_mode", "light_sampling",      "light_resolution"};

// One way to make a frame, and what it is worth for a use: less is better.
struct Found {
  TradeSettings settings;
  Making making = {};
  double seconds = never, error = never;
  double worth = never;
  bool is_whole = true;
};

using Judge = std::function<Found(const TradeSettings&)>;

// Goes along the axes until a round changes nothing, at most twice.
void descend_from(Found& best, const std::vector<TradeAxis>& axes, const Judge& judge,
                  const TradeProbe& probe, const std::string& use) {
  for (int round = 0; round < 2; ++round) {
    bool is_better = false;
    for (const TradeAxis& axis : axes) {
      for (const TradeVariant& variant : axis.variants) {
        TradeSettings settings = best.settings;
        variant.change(settings);
        if (settings == best.settings) continue;
        probe.step(use + ": " + axis.name + " " + variant.name);
        Found found = judge(settings);
        if (!(found.worth < worth_keeping * best.worth)) continue;
        best = std::move(found);
        is_better = true;
      }
    }
    if (!is_better) break;
  }
}

// The set's own settings are judged whatever the time; from there on it goes as far as that
// reaches.
Found descend(const TradeSettings& own, const std::vector<TradeAxis>& axes, const Judge& judge,
              const TradeProbe& probe, const std::string& use, TradePhase phase) {
  probe.limit(std::nullopt);
  probe.step(use + ": the set's own settings");
  Found best = judge(own);
  probe.limit(phase);
  try {
    descend_from(best, axes, judge, probe, use);
  } catch (const OutOfTime&) {
    best.is_whole = false;
  }
  probe.limit(std::nullopt);
  return best;
}

// The least error among what holds the rate. Where nothing does, the time of the fastest counts,
// far behind any error.
Found judge_live(const TradeSettings& settings, double planned_s, const TradeProbe& probe) {
  constexpr double behind = 1e6;
  const PathCost cost = probe.cost(settings, true);
  Found best{settings};
  for (const double scale : scales)
    for (const bool denoise : {true, false}) {
      Making making{1, scale, denoise};
      const int samples = cost.samples_within(planned_s, making);
      making.samples = std::max(samples, 1);
      const double seconds = cost.seconds(making);
      const double error = samples > 0 ? probe.error(settings, making) : never;
      const double worth = samples > 0 ? error : behind * seconds;
      if (worth < best.worth) best = {settings, making, seconds, error, worth};
    }
  return best;
}

// The least time in which the error is reached, at full size.
Found judge_still(const TradeSettings& settings, double wanted, const TradeProbe& probe) {
  const PathCost cost = probe.cost(settings, false);
  Found best{settings};
  for (const bool denoise : {true, false}) {
    const double of_few = probe.error(settings, {few, 1, denoise});
    const double of_many = probe.error(settings, {many, 1, denoise});
    Making making{samples_for(wanted, few, of_few, many, of_many), 1, denoise};
    const bool is_reached = making.samples > 0;
    if (!is_reached) making.samples = most_offline;
    const double seconds = cost.seconds(making);
    const double error = is_reached ? wanted : std::min(of_few, of_many);
    const double worth = is_reached ? seconds : seconds * 1e6;
    if (worth < best.worth) best = {settings, making, seconds, error, worth};
  }
  return best;
}

std::vector<TradeStep> steps_of(const TradeSettings& settings, double slowest_s,
                                const TradeProbe& probe) {
  const PathCost cost = probe.cost(settings, true);
  std::vector<TradeStep> all;
  probe.limit(TradePhase::live_steps);
  try {
    // First what is fastest: a preview that cannot go below its rate's step falls behind.
    for (const int samples : step_samples)
      for (const double scale : scales)
        for (const bool denoise : {true, false}) {
          const Making making{samples, scale, denoise};
          const double seconds = cost.seconds(making);
          // Far above what a preview may take.
          if (seconds > slowest_s) continue;
          all.push_back({making, seconds, probe.error(settings, making)});
        }
  } catch (const OutOfTime&) {
    // Steps of few samples are there, which is what live needs.
  }
  probe.limit(std::nullopt);
  return best_steps(std::move(all));
}

set::Set with(set::Set set, const TradeSettings& settings) {
  const std::uint32_t seed = set.estimation.seed;
  set.estimation = settings.estimation;
  set.estimation.seed = seed;
  set.lighting = settings.lighting;
  return set;
}

std::string unfinished_words(const Found& found) {
  return found.is_whole ? "" : "; there was no time to try all settings";
}

TradeAnswer answer_live(const TradeQuestion& question, const set::Set& set, const Found& found,
                        const TradeProbe& probe) {
  const double frame_s = 1 / question.fps;
  const double planned_s = pipeline::Governor::headroom * frame_s;
  TradeAnswer answer{.use = "live", .settings = found.settings, .making = found.making};
  answer.seconds = found.seconds;
  answer.error = found.error;
  answer.is_met = found.seconds <= planned_s;
  answer.is_whole = found.is_whole;
  set::Set wanted = with(set, found.settings);
  wanted.quality.fps = question.fps;
  probe.step("live: the steps of the preview");
  for (const TradeStep& step : steps_of(found.settings, 4 * frame_s, probe))
    wanted.quality.steps.push_back({step.making.samples, step.making.scale, step.making.denoise});
  if (wanted.quality.steps.empty())
    wanted.quality.steps.push_back({1, found.making.scale, found.making.denoise});
  answer.toml = set::overlay_toml(set, wanted);
  answer.words =
      answer.is_met
          ? fmt::format(
                "{:g} pictures a second with {} at {:.0f} % of the size{}, error {}", question.fps,
                found.making.samples == 1 ? "1 sample"
                                          : std::to_string(found.making.samples) + " samples",
                100 * found.making.scale, found.making.denoise ? ", denoised" : "",
                share_words(found.error))
          : fmt::format("{:g} pictures a second are more than this machine makes: {:.2g} at most",
                        question.fps, 1 / found.seconds);
  answer.words += unfinished_words(found);
  return answer;
}

TradeAnswer answer_still(const std::string& use, const TradeQuestion& question, const set::Set& set,
                         const Found& found) {
  TradeAnswer answer{.use = use, .settings = found.settings, .making = found.making};
  answer.seconds = found.seconds;
  answer.error = found.error;
  answer.is_met = found.error <= question.error;
  answer.is_whole = found.is_whole;
  set::Set wanted = with(set, found.settings);
  wanted.quality.steps.clear();
  wanted.quality.denoise = found.making.denoise;
  wanted.quality.samples = found.making.samples;
  answer.toml = set::overlay_toml(set, wanted);
  answer.words = answer.is_met
                     ? fmt::format("error {} after {}, with {} samples{}",
                                   share_words(question.error), time_words(found.seconds),
                                   found.making.samples, found.making.denoise ? ", denoised" : "")
                     : fmt::format("an error of {} is not reached; {} is the least seen",
                                   share_words(question.error), share_words(found.error));
  answer.words += unfinished_words(found);
  return answer;
}

}  // namespace

std::vector<TradeAxis> searched_axes(const TradeSettings& own, std::uint32_t needed) {
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

int samples_for(double wanted, int few_samples, double error_of_few, int many_samples,
                double error_of_many) {
  const double few_squared = error_of_few * error_of_few;
  const double many_squared = error_of_many * error_of_many;
  const double n = few_samples, m = many_samples;
  const double variance = std::max((few_squared - many_squared) * n * m / (m - n), 0.0);
  const double bias_squared = std::max(many_squared - variance / m, 0.0);
  const double left = wanted * wanted - bias_squared;
  if (!(left > 0)) return 0;
  const double samples = std::ceil(variance / left);
  return samples > most_offline ? 0 : std::max(static_cast<int>(samples), 1);
}

std::vector<TradeAnswer> answer(const TradeQuestion& question, const set::Set& set,
                                const TradeSettings& own, const std::vector<TradeAxis>& axes,
                                const TradeProbe& probe) {
  const double planned_s = pipeline::Governor::headroom / question.fps;
  const Found live = descend(
      own, axes, [&](const TradeSettings& s) { return judge_live(s, planned_s, probe); }, probe,
      "live", TradePhase::live);
  TradeAnswer for_live = answer_live(question, set, live, probe);
  // A refinement keeps the layers, as a render does, and so finds its settings in the same way.
  const Found still = descend(
      own, axes, [&](const TradeSettings& s) { return judge_still(s, question.error, probe); },
      probe, "refine and post", TradePhase::still);
  return {std::move(for_live), answer_still("refine", question, set, still),
          answer_still("post", question, set, still)};
}

}  // namespace previz::trade
