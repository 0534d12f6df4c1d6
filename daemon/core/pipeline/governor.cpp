#include "daemon/core/pipeline/governor.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <utility>

namespace previz::pipeline {
namespace {

// A better step must fit with this share of the planned time, so that the size does not swing.
constexpr double to_rise = 0.95;
// A step that is left so soon after a better one was tried doubles the wait for the next try.
constexpr int soon = 50, longest_hold = 1500;  // frames
constexpr int first_frames = 25;               // in which a late frame now and then is no matter
constexpr int between_risks = 100;             // frames, of which one may be late
constexpr int most_alike = 40;                 // frames, before one has fewer samples
// More late frames than these cannot be helped by fewer samples: something else makes them late.
constexpr double most_late_ratio = 1.25;
// Two steps in a row that save less than this say that pixels are not what costs time.
constexpr double worth_a_step = 0.95;
constexpr int is_settled = 6;  // frames at a step

}  // namespace

std::vector<set::PreviewStep> preview_steps(const set::Quality& quality) {
  if (!quality.steps.empty()) return quality.steps;
  std::vector<set::PreviewStep> steps;
  const auto scale_of = [&](int halvings) { return quality.scale * std::pow(0.5, 0.5 * halvings); };
  steps.push_back({1, quality.scale, {}});
  for (int i = 1; scale_of(i) >= Governor::least_scale; ++i) steps.push_back({1, scale_of(i), {}});
  return steps;
}

Governor::Governor(double fps, std::vector<set::PreviewStep> steps) : frame_s_(1 / fps) {
  assert(fps > 0 && !steps.empty());
  for (set::PreviewStep& step : steps) {
    step.samples = std::clamp(step.samples, 1, most_samples);
    steps_.push_back({step, step.scale * step.scale});
  }
  samples_ = usual_ = step().samples;
}

Governor::Governor(double fps, double largest_scale)
    : Governor(fps, [&] {
        set::Quality quality;
        quality.scale = largest_scale;
        return preview_steps(quality);
      }()) {}

double Governor::planned_s() const {
  const double late = std::clamp(cost_.late_ratio().value_or(1 / headroom), 1.0, most_late_ratio);
  return std::min(headroom, 1 / late) * frame_s_;
}

// How much cheaper frames have become since this step was gone to; 1 where they have not.
double Governor::drift() const {
  if (entry_seconds_ <= 0) return 1;
  return std::min(cost_.seconds(entry_work_) / entry_seconds_, 1.0);
}

// The fixed part of a step. That of one that was never tried is at best proportional to its pixels,
// going down, and no larger than that of the step that is used, going up.
double Governor::fixed_of(std::size_t step) const {
  if (step == at_) return cost_.fixed();
  const Step& it = steps_[step];
  if (it.known) return std::max(it.seconds * drift() - cost_.per_work() * it.work, 0.0);
  std::size_t above = step;
  while (above > 0 && above != at_ && !steps_[above].known) --above;
  const bool has_above = above != step && (above == at_ || steps_[above].known);
  const double share = has_above ? std::min(it.pixels / steps_[above].pixels, 1.0) : 1;
  return share * (has_above && above != at_ ? fixed_of(above) : cost_.fixed());
}

double Governor::least_seconds(std::size_t step) const {
  const Step& it = steps_[step];
  return fixed_of(step) + cost_.per_work() * work(it, it.step.samples);
}

// A step that was never tried is not worth a try where those above it have saved nothing.
bool Governor::is_hopeless(std::size_t step) const {
  std::size_t first = at_;
  while (first < steps_.size() && (first == at_ || steps_[first].known)) ++first;
  if (step < first || first < 3) return false;
  const auto saves = [&](std::size_t i) {
    return least_seconds(i) < worth_a_step * least_seconds(i - 1);
  };
  return !saves(first - 1) && !saves(first - 2);
}

std::size_t Governor::choose_step() const {
  const bool may_rise = frames_here_ >= hold_;
  for (std::size_t i = may_rise ? 0 : at_; i < steps_.size(); ++i) {
    if (i > at_ && !steps_[i].known && is_hopeless(i)) continue;
    if (least_seconds(i) <= (i < at_ ? to_rise : 1) * planned_s()) return i;
  }
  return least_bad();
}

// Where nothing fits: halving the pixels must save 16 % = 1 - 2^-0.25 of the time.
std::size_t Governor::least_bad() const {
  std::size_t best = at_;
  const auto loss = [&](std::size_t i) {
    return least_seconds(i) / std::pow(steps_[i].pixels, 0.25);
  };
  bool tried = true;
  for (std::size_t i = 0; i < steps_.size() && tried; ++i) {
    tried = i == at_ || steps_[i].known;
    if (!tried && (i < at_ || is_hopeless(i))) continue;
    if (i < at_ && frames_here_ < is_settled) continue;
    if (loss(i) < loss(best)) best = i;
  }
  return best;
}

void Governor::go_to(std::size_t step) {
  if (step == at_) return;
  const double fixed = fixed_of(step);
  Step& left = steps_[at_];
  left.known = true;
  left.work = work(left, samples_);
  left.seconds = cost_.seconds(left.work);
  if (rose_ && step > at_ && frames_here_ < soon) hold_ = std::min(2 * hold_, longest_hold);
  rose_ = step < at_;
  const bool known = steps_[step].known;
  const double deviation = known ? 0.05 * left.seconds : std::max(fixed, 0.5 * left.seconds);
  at_ = step;
  frames_here_ = 0;
  entry_seconds_ = 0;
  cost_.use_fixed(fixed, deviation, known ? steps_[step].work : left.work);
}

void Governor::took(double seconds) {
  if (!(seconds > 0) || !std::isfinite(seconds)) return;
  Step& here = steps_[at_];
  if (cost_.took(work(here, samples_), seconds) == FrameCost::Saw::changed) {
    // What was learned of the other steps was learned of another scene.
    for (Step& step : steps_) step.known = false;
    frames_ = 0;
    hold_ = settle_frames;
    entry_seconds_ = 0;
  }
  here.known = true;
  ++frames_;
  ++since_risk_;
  if (++frames_here_ == is_settled) {
    entry_work_ = work(here, samples_);
    entry_seconds_ = cost_.seconds(entry_work_);
  }
  if (!cost_.is_in_doubt()) {
    const std::size_t step = choose_step();
    if (step != at_) {
      go_to(step);
      usual_ = this->step().samples;
    }
  }
  if (cost_.asks_again()) return;
  const int before = samples_;
  usual_ = choose_samples();
  samples_ = vary(usual_);
  alike_ = samples_ == before && frames_here_ > 0 ? alike_ + 1 : 0;
}

// Samples grow by no more than to twice their number and one, so that each step teaches what a
// sample costs before the next.
int Governor::choose_samples() const {
  const Step& here = steps_[at_];
  // A plan that is met to a hundredth is met.
  const double plan = 1.01 * planned_s();
  int chosen = here.step.samples;
  while (chosen < most_samples && chosen < 2 * usual_ + 1) {
    const double more = work(here, chosen + 1);
    const double unknown = chosen + 1 > usual_ ? cost_.deviation(more) : 0;
    if (cost_.seconds(more) + unknown > plan) break;
    ++chosen;
  }
  return chosen;
}

// Returns the samples of the next frame, where `usual` fit for certain.
int Governor::vary(int usual) {
  if (usual > samples_ || usual == most_samples || cost_.is_in_doubt() || frames_here_ == 0)
    return usual;
  const Step& here = steps_[at_];
  const double more = work(here, usual + 1);
  const bool may_fit = cost_.share_unknown() > 0.25 &&
                       cost_.seconds(more) - cost_.deviation(more) <= 1.01 * planned_s();
  const bool is_risk = cost_.seconds(more) > frame_s_;
  const bool may_risk = frames_ <= first_frames || since_risk_ >= between_risks;
  const bool is_least = usual == here.step.samples;
  if ((may_fit && (!is_risk || may_risk)) || (is_least && alike_ >= between_risks)) {
    if (is_risk) since_risk_ = 0;
    return usual + 1;
  }
  if (!is_least && alike_ >= most_alike) return std::max(here.step.samples, 3 * usual / 4);
  return usual;
}

}  // namespace previz::pipeline
