#include "daemon/tools/trade/sweep.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <ostream>
#include <span>
#include <utility>

#include "daemon/core/pipeline/metrics.hpp"
#include "daemon/core/pipeline/preview_size.hpp"
#include "daemon/core/render/picture/composite.hpp"
#include "daemon/tools/trade/rehearsal.hpp"
#include "drivers/error.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::trade {
namespace {

// A long rendering is cut into parts, for the progress line and so that it can be stopped.
constexpr int parts_of_half = 32;
// A reference is enough for the answers if its noise is this share of the error that is asked for.
constexpr double enough_noise = 0.25;
// A rehearsal is long enough for the governor to settle and for some pictures of a slow machine.
constexpr double rehearsal_s = 12, shortest_rehearsal_s = 4;

timing::FrameSettings own_settings(const timing::TimedFrame& frame) {
  timing::FrameSettings own;
  own.estimation = frame.set().estimation;
  own.lighting = frame.set().lighting;
  own.lens = frame.calibration().lens;
  own.adaptive = frame.set().quality.adaptive;
  own.denoise = frame.set().quality.denoise;
  return own;
}

TradeQuestion question_of(const TradeOptions& options, const timing::TimedFrame& frame) {
  const double fps = frame.set().quality.fps;
  return {options.fps.value_or(fps > 0 ? fps : TradeQuestion().fps),
          options.error.value_or(TradeQuestion().error)};
}

double steady_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// Returns the square of a method's error after a time, between its points as a power of the time.
double squared_after(const std::vector<TradePoint>& points, double seconds, double noise_squared) {
  const auto squared = [&](const TradePoint& point) {
    const double error = point.errors.picture.value_or(0);
    return std::max(error * error - noise_squared, 0.01 * error * error);
  };
  std::size_t i = 1;
  while (i + 1 < points.size() && points[i].seconds < seconds) ++i;
  if (points.size() == 1) return squared(points.front());
  const double slope = std::log(squared(points[i]) / squared(points[i - 1])) /
                       std::log(points[i].seconds / points[i - 1].seconds);
  if (!std::isfinite(slope)) return squared(points[i]);
  return squared(points[i]) *
         std::exp(std::clamp(slope, -1.0, 0.0) * std::log(seconds / points[i].seconds));
}

}  // namespace

Sweep::Sweep(const TradeOptions& options, timing::TimedFrame& frame, const scene::Scene& scene,
             std::shared_ptr<render::Device> device, TradeCache& cache)
    : options_(options),
      frame_(frame),
      scene_(scene),
      device_(std::move(device)),
      cache_(cache),
      budget_(options.minutes ? std::optional(60 * *options.minutes) : std::nullopt, steady_s(),
              options.answers),
      probes_({.device = device_,
               .frame = frame_,
               .scene = scene_,
               .budget = budget_,
               .scale = options.scale,
               .rounds = options.rounds,
               .live_limit_s = 2 / question_of(options, frame).fps,
               .seed = [this](int round) { return seed(round); },
               .now_s = steady_s,
               .stop = options.stop},
              own_settings(frame), cache),
      start_s_(steady_s()),
      last_s_(start_s_) {
  const PinholeIntrinsics& full = frame.calibration().intrinsics;
  const PinholeIntrinsics sweep = pipeline::scaled(frame.calibration(), options.scale).intrinsics;
  report_.set = frame.set().name;
  report_.device = render::device_name(*device_);
  report_.frame = frame.index();
  report_.width = sweep.width;
  report_.height = sweep.height;
  report_.full_width = full.width;
  report_.full_height = full.height;
  report_.rounds = options.rounds;
  report_.reference_samples = 2 * (*options.reference_samples / 2);
  plan();
}

void Sweep::plan() {
  const timing::FrameSettings own = own_settings(frame_);
  MethodRenderer renderer(device_, frame_, scene_, own, options_.scale);
  renderer.begin(own.estimation.seed);
  needed_ = renderer.needed();
  timing::FrameSettings with_photons = own;
  with_photons.estimation.caustics = set::Caustics::photons;
  if (own != with_photons) {
    MethodRenderer other(device_, frame_, scene_, with_photons, options_.scale);
    other.begin(own.estimation.seed);
    needed_ |= other.needed() & gpu::FEATURE_PHOTONS;
  }
  report_.plan = plan_trade(own, trade_axes(own, needed_), options_.axes);

  for (const TradePlan::Method& method : report_.plan.methods) {
    report_.methods.emplace_back().name = method.name;
  }
  best_.resize(report_.methods.size());
  for (std::size_t m = 0; m < report_.methods.size(); ++m)
    if (const KeptMethod* kept =
            cache_.method(settings_words(frame_.set(), report_.plan.methods[m].settings))) {
      report_.methods[m].bias = kept->bias;
      report_.methods[m].changed_pixels = kept->changed_pixels;
    }
}

TradeReport Sweep::run(std::ostream& out, const std::function<void(const TradeReport&)>& save) {
  const int methods = static_cast<int>(report_.methods.size());
  const int once = std::reduce(options_.samples.begin(), options_.samples.end()) + 1;
  const int corners = 3 * options_.samples.back();
  const double work = report_.reference_samples + 1.0 * methods * options_.rounds * once + corners;
  progress_.emplace(out, options_.terminal, budget_.is_limited() ? budget_.seconds() : work,
                    last_s_);
  out << report_.set << ": frame " << report_.frame << " at " << report_.width << "x"
      << report_.height << ", " << methods << " variants on " << report_.plan.axes.size()
      << " axes, reference of " << report_.reference_samples << " samples, on " << report_.device;
  if (budget_.is_limited())
    out << ", within " << output::duration_words(budget_.seconds()) << " (--minutes)";
  out << std::endl;
  try {
    make_reference();
    sweep(save);
    find_corners();
    save(report_);
    if (options_.answers) find_answers();
  } catch (const Stopped&) {
    report_.interrupted = true;
    if (reference_) conclude();
  }
  return std::move(report_);
}

// With a budget, work is counted by the clock, so that the line shows what is left of that.
void Sweep::worked(const std::string& step, double work) {
  const double now = steady_s();
  progress_->worked(step, budget_.is_limited() ? now - last_s_ : work, now);
  last_s_ = now;
}

TradePicture Sweep::picture_of(const render::Layers& layers) const {
  const PlatePtr plate = frame_.plate(options_.scale);
  return trade_picture(layers, render::plate_radiance(*plate, frame_.response(), frame_.exposure()),
                       1 / frame_.exposure());
}

// Says what to give, so that there is a reference.
void Sweep::refuse_short_reference(int samples, double began_s) const {
  const double now = steady_s(), rendered_s = now - began_s;
  const double needed_s =
      now - start_s_ + rendered_s * (1.0 * least_reference_samples / samples - 1);
  const double minutes = std::ceil(budget_.for_phase(TradePhase::least_reference, needed_s) / 60);
  const double scale = options_.scale * std::sqrt(0.8 * samples / least_reference_samples);
  throw Error(fmt::format(
      "--minutes {:g}: errors are measured against a picture of {} samples or more, and it got {} "
      "in its share of that time; nothing was measured, and no file is written. Give --minutes "
      "{:g}, or --scale {:.2g} for a smaller picture",
      *options_.minutes, least_reference_samples, samples, std::max(minutes, 1.0), scale));
}

// More of the reference tells little where its noise is far below the error that is asked for.
bool Sweep::is_enough(const KeptReference& reference) const {
  if (reference.samples >= report_.reference_samples / 2) return true;
  if (!options_.answers || 2 * reference.samples < least_reference_samples) return false;
  const TradeReference so_far(picture_of(reference.halves[0]), picture_of(reference.halves[1]));
  return so_far.noise().picture.value_or(0) <= question_of(options_, frame_).error * enough_noise;
}

// Both halves grow together, so that there is a reference whenever time is over. On its way the
// first half shows how the error of the set's own settings falls. What is kept of an earlier
// reference has other random numbers.
void Sweep::make_reference() {
  constexpr std::uint32_t beyond_all_rounds = 1u << 20;
  constexpr double step_s = 1;
  const KeptReference before = cache_.reference;
  const int samples = report_.reference_samples / 2, most = std::max(samples / parts_of_half, 1);
  std::vector<OnTheWay> seen;
  int done = 0;
  const double began = steady_s();
  if (!is_enough(before)) {
    std::array<MethodRenderer, 2> halves{renderer_of(0), renderer_of(0)};
    const auto used = 2 * static_cast<std::uint32_t>(before.samples);
    for (std::uint32_t half = 0; half < 2; ++half)
      halves[half].begin(seed(0) + beyond_all_rounds + used + half);
    for (int step = 1, next = 1; before.samples + done < samples;) {
      const int now = std::min({step, samples - before.samples - done, next - done});
      const double begun = steady_s();
      for (MethodRenderer& half : halves) half.add(now);
      done += now;
      worked("reference", 2.0 * now);
      const double took = std::max(steady_s() - begun, 1e-6);
      step = std::clamp(static_cast<int>(now * step_s / took), 1, most);
      const bool is_short = 2 * (before.samples + done) < least_reference_samples;
      const bool is_over =
          options_.stop.stop_requested() ||
          budget_.is_over(is_short ? TradePhase::least_reference : TradePhase::reference,
                          steady_s());
      if (done < next && !is_over) continue;
      cache_.reference = before;
      cache_.reference.add(done, {&halves[0].layers(), &halves[1].layers()});
      if (done == next) seen.push_back({done, halves[0].picture(), halves[0].denoised_picture()});
      next *= 2;
      if (is_over || is_enough(cache_.reference)) break;
    }
    if (cache_.reference.samples < before.samples + done) {
      cache_.reference = before;
      cache_.reference.add(done, {&halves[0].layers(), &halves[1].layers()});
    }
  }
  if (2 * cache_.reference.samples < least_reference_samples) {
    stop_if_asked();
    refuse_short_reference(2 * done, began);
  }
  use_reference();
  const StillCurves now = curves_of(seen);
  if (cache_.reference.curves.noisy.points().size() < now.noisy.points().size())
    cache_.reference.curves = now;
  // Both halves together are another point of it.
  ErrorCurve& curve = cache_.reference.curves.noisy;
  if (curve.empty() || report_.reference_samples > curve.points().back().samples)
    curve.add(report_.reference_samples, reference_->squared_noise());
  progress_->step_done("reference of " + std::to_string(report_.reference_samples) + " samples" +
                           (before.samples > 0 ? ", " + std::to_string(2 * before.samples) +
                                                     " of them from the last time"
                                               : ""),
                       steady_s());
}

void Sweep::use_reference() {
  const KeptReference& kept = cache_.reference;
  report_.reference_samples = 2 * kept.samples;
  reference_.emplace(picture_of(kept.halves[0]), picture_of(kept.halves[1]));
  report_.noise = reference_->noise();
  cache_.change_noise(report_.noise);
  report_.reference = displayed(reference_->picture());
  const auto& added = reference_->picture().added;
  if (std::ranges::all_of(added, [](const glm::vec3& light) { return light == glm::vec3(0); }))
    throw Error(frame_.set().file.string() + ": frame " + std::to_string(report_.frame) +
                ": nothing virtual, removed or relit is visible in it; nothing to measure");
  probes_.use(*reference_);
}

StillCurves Sweep::curves_of(const std::vector<OnTheWay>& seen) const {
  StillCurves curves;
  for (const OnTheWay& at : seen) {
    curves.noisy.add(at.samples, reference_->squared_error_by_second_half(at.noisy));
    curves.denoised.add(at.samples, reference_->squared_error_by_second_half(at.denoised));
  }
  return curves;
}

KeptPoint& Sweep::kept(std::size_t method, std::size_t point) {
  return cache_.point(settings_words(frame_.set(), report_.plan.methods[method].settings),
                      options_.samples[point]);
}

int Sweep::rounds_of(std::size_t method) {
  int rounds = std::numeric_limits<int>::max();
  for (std::size_t i = 0; i < options_.samples.size(); ++i)
    rounds = std::min(rounds, static_cast<int>(kept(method, i).errors.size()));
  return rounds;
}

// Methods take turns, so that a drift of the machine's speed does not favour one of them.
void Sweep::sweep(const std::function<void(const TradeReport&)>& save) {
  const int methods = static_cast<int>(report_.methods.size());
  for (int round = 0; round < options_.rounds; ++round) {
    for (int i = 0; i < methods; ++i) {
      const auto turned =
          static_cast<std::size_t>((i + round * methods / options_.rounds) % methods);
      if (rounds_of(turned) > round) continue;     // from the last time
      const bool is_first = round == 0 && i == 0;  // without the set's own there is no table
      if (is_first || has_time_for_a_method()) measure(turned, round);
    }
    conclude();
    save(report_);
  }
}

bool Sweep::has_time_for_a_method() const {
  return !budget_.is_over(TradePhase::sweep, steady_s() + of_a_method_s_);
}

void Sweep::measure(std::size_t method, int round) {
  const double before = steady_s();
  const std::string& name = report_.methods[method].name;
  MethodRenderer renderer = renderer_of(method);
  renderer.warm_up();
  worked(name, 1);
  for (std::size_t i = 0; i < options_.samples.size(); ++i) {
    renderer.begin(seed(round));
    const double seconds = renderer.render(options_.samples[i]);
    stop_if_asked();
    const TradePicture picture = renderer.picture();
    KeptPoint& point = kept(method, i);
    if (point.errors.size() <= static_cast<std::size_t>(round)) {
      point.seconds.push_back(seconds);
      point.errors.push_back(reference_->errors(picture));
    }
    if (point.squared.size() <= static_cast<std::size_t>(round))
      point.squared.push_back(reference_->squared_error(picture));
    if (i + 1 == options_.samples.size()) best_[method][round] = picture;
    worked(name, options_.samples[i]);
  }
  if (round == 0) compare_parts(method, renderer.layers());
  of_a_method_s_ = std::max(of_a_method_s_, steady_s() - before);
  progress_->step_done(
      "round " + std::to_string(round + 1) + " of " + std::to_string(options_.rounds) + ", " + name,
      steady_s());
}

void Sweep::compare_parts(std::size_t method, const render::Layers& layers) {
  if (method == 0) own_ = layers;
  if (report_.plan.methods[method].settings.carried == 0) return;
  if (own_.composite.empty()) {
    MethodRenderer own = renderer_of(0);
    own.begin(seed(0));
    own.render(options_.samples.back());
    own_ = own.layers();
  }
  std::size_t changed = 0;
  for (std::size_t i = 0; i < layers.composite.size(); ++i)
    changed += layers.composite[i] != own_.composite[i] || layers.diff[i] != own_.diff[i] ||
               layers.mask[i] != own_.mask[i];
  report_.methods[method].changed_pixels = changed;
}

// Returns the pictures of the rounds that both methods have from this run.
std::pair<std::vector<TradePicture>, std::vector<TradePicture>> Sweep::alike(
    std::size_t method) const {
  std::pair<std::vector<TradePicture>, std::vector<TradePicture>> pictures;
  for (const auto& [round, picture] : best_[method])
    if (const auto own = best_[0].find(round); own != best_[0].end()) {
      pictures.first.push_back(picture);
      pictures.second.push_back(own->second);
    }
  return pictures;
}

// Makes of the rounds so far what the table and the page show. A method of which a number of
// samples was not measured has no points.
void Sweep::conclude() {
  std::vector<TradePoint*> candidates;
  std::vector<TradeCost> costs;
  report_.unmeasured.clear();
  cache_.methods.clear();
  for (std::size_t m = 0; m < report_.methods.size(); ++m) {
    TradeMethod& method = report_.methods[m];
    if (rounds_of(m) == 0) {
      report_.unmeasured.push_back(method.name);
      continue;
    }
    method.points.resize(options_.samples.size());
    for (std::size_t i = 0; i < method.points.size(); ++i) {
      const KeptPoint& rounds = kept(m, i);
      TradePoint& point = method.points[i];
      point.samples = options_.samples[i];
      point.seconds = pipeline::quantile(rounds.seconds, 0.5);
      point.errors = rms(rounds.errors);
      point.within_noise = within_noise(point.errors, report_.noise);
      if (method.changed_pixels) continue;  // features that are not needed are no choice
      candidates.push_back(&point);
      costs.push_back({point.seconds, point.errors.picture.value_or(0)});
    }
    const auto [pictures, own] = alike(m);
    if (pictures.size() >= 3) method.bias = reference_->bias(pictures, own);
    cache_.methods.push_back({settings_words(frame_.set(), report_.plan.methods[m].settings),
                              method.bias, method.changed_pixels});
  }
  const std::vector<bool> front = pareto_front(costs);
  for (std::size_t i = 0; i < front.size(); ++i) candidates[i]->pareto = front[i];
}

void Sweep::find_corners() {
  const std::vector<TradeFrontPoint> front = front_of(report_);
  std::vector<TradeCost> costs;
  for (const TradeFrontPoint& at : front)
    costs.push_back({report_.point(at).seconds, report_.point(at).errors.picture.value_or(0)});
  const auto add = [&](const char* name, const TradeFrontPoint& at) {
    stop_if_asked();
    report_.corners.push_back(corner(name, at));
    worked(name, options_.samples.back());
  };
  add("fastest", front.front());
  const std::size_t bend = knee(costs);
  if (bend > 0 && bend + 1 < front.size()) add("knee", front[bend]);
  if (front.size() > 1) add("best", front.back());
  progress_->step_done("pictures at the corners", steady_s());
}

TradeCorner Sweep::corner(const std::string& name, const TradeFrontPoint& at) const {
  MethodRenderer renderer = renderer_of(at.method);
  renderer.begin(seed(0));
  renderer.render(report_.point(at).samples);
  const Plate shown = displayed(renderer.picture());
  TradeCorner corner{name, at, shown, shown};
  for (std::size_t i = 0; i < corner.difference.samples.size(); ++i) {
    const int off = static_cast<int>(corner.difference.samples[i]) - report_.reference.samples[i];
    corner.difference.samples[i] = static_cast<std::uint16_t>(std::clamp(128 + 5 * off, 0, 255));
  }
  return corner;
}

Plate Sweep::displayed(const TradePicture& picture) const {
  const lighting::Response response(frame_.calibration().response, 8);
  Plate plate{picture.width, picture.height, 8, {}};
  plate.samples.reserve(3 * picture.shown.size());
  for (const glm::vec3& radiance : picture.shown)
    for (int c = 0; c < 3; ++c)
      plate.samples.push_back(
          response.forward(frame_.exposure() * static_cast<double>(radiance[c])));
  return plate;
}

// Compares a method with the set's own, in the time of the latter at few samples, or at the most.
double Sweep::gain(const timing::FrameSettings& settings, bool is_live) const {
  const auto planned =
      std::ranges::find(report_.plan.methods, settings, &TradePlan::Method::settings);
  if (planned == report_.plan.methods.end()) return 1;
  const std::vector<TradePoint>& own = report_.methods.front().points;
  const std::vector<TradePoint>& other =
      report_.methods[static_cast<std::size_t>(planned - report_.plan.methods.begin())].points;
  if (own.empty() || other.empty()) return 1;
  const double noise = report_.noise.picture.value_or(0);
  const double seconds = is_live ? own.front().seconds : own.back().seconds;
  return squared_after(own, seconds, noise * noise) / squared_after(other, seconds, noise * noise);
}

// The rehearsal has the time that its phase leaves; without any there is none.
Rehearsal Sweep::rehearsal_of(const set::Set& set) {
  const double left = budget_.left(TradePhase::live_rehearsal, steady_s());
  if (left < shortest_rehearsal_s) return {};
  Rehearsal rehearsal;
  try {
    rehearsal =
        rehearse(device_, set, scene_, frame_.take(), std::min(left, rehearsal_s), options_.stop);
  } catch (const Error& error) {
    rehearsal.why_not = error.what();
  }
  stop_if_asked();
  return rehearsal;
}

void Sweep::find_answers() {
  report_.question = question_of(options_, frame_);
  const timing::FrameSettings& own = report_.plan.methods.front().settings;
  std::vector<TradeAxis> axes = searched_axes(own, needed_);
  if (!options_.axes.empty())
    std::erase_if(axes, [&](const TradeAxis& axis) {
      return std::ranges::find(options_.axes, axis.name) == options_.axes.end();
    });
  report_.answers = answer(
      report_.question, frame_.set(), own, axes,
      {.error = [this](const timing::FrameSettings& s, const timing::Making& m,
                       bool stated) { return probes_.error(s, m, stated); },
       .curves = [this](const timing::FrameSettings& s,
                        double wanted) { return probes_.curves(s, wanted); },
       .gain = [this](const timing::FrameSettings& s, bool is_live) { return gain(s, is_live); },
       .cost = [this](const timing::FrameSettings& s,
                      bool is_live) { return probes_.cost(s, is_live); },
       .rehearse = [this](const set::Set& set) { return rehearsal_of(set); },
       .take_fps = frame_.take_fps(),
       .step =
           [this](const std::string& what) {
             stop_if_asked();
             worked("search, " + what, 0);
             progress_->step_done("search, " + what, steady_s());
           },
       .limit = [this](std::optional<TradePhase> phase) { probes_.limit(phase); }});
}

}  // namespace previz::trade
