#include "daemon/trade/trade.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <functional>
#include <numeric>
#include <ostream>
#include <span>
#include <utility>

#include "daemon/output/progress.hpp"
#include "daemon/pipeline/metrics.hpp"
#include "daemon/pipeline/preview_size.hpp"
#include "daemon/scene/scene.hpp"
#include "daemon/set/problems.hpp"
#include "daemon/trade/budget.hpp"
#include "daemon/trade/frame.hpp"
#include "daemon/trade/method.hpp"
#include "daemon/trade/page.hpp"
#include "drivers/error.hpp"
#include "drivers/session/files.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::trade {
namespace {

namespace fs = std::filesystem;

// With so many times the samples of the best row, the reference's error is a sixteenth of that
// row's.
constexpr int reference_over_most = 256;
constexpr int most_samples = 1'000'000;
// A long rendering is cut into parts, for the progress line and so that it can be stopped.
constexpr int parts_of_half = 32;

double steady_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

struct Stopped {};

class Sweep {
 public:
  Sweep(const TradeOptions& options, TradeFrame& frame, std::ostream& out);
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
  TradePicture at_sweep_size(const TradePicture& picture) const {
    return enlarged(picture, report_.width, report_.height);
  }
  void plan();
  void make_reference();
  void sweep(const std::function<void(const TradeReport&)>& save);
  bool has_time_for_a_method() const;
  void worked(const std::string& step, double work);
  void measure(std::size_t method, int round);
  void compare_parts(std::size_t method, const render::Layers& layers);
  void conclude();
  void find_corners();
  TradeCorner corner(const std::string& name, const TradeFrontPoint& at) const;
  Plate displayed(const TradePicture& picture) const;
  void find_answers();
  double probe_error(const TradeSettings& settings, const Making& making);
  PathCost probe_cost(const TradeSettings& settings, bool is_live);
  void stop_if_asked() const {
    if (options_.stop.stop_requested()) throw Stopped();
  }
  void stop_if_over() const {
    stop_if_asked();
    if (probed_phase_ && budget_.is_over(*probed_phase_, steady_s())) throw OutOfTime();
  }

  const TradeOptions& options_;
  TradeFrame& frame_;
  const scene::Scene scene_;
  const std::shared_ptr<render::Device> device_;
  TradeReport report_;
  std::optional<TradeReference> reference_;
  // The measurements of one point, with one entry a round.
  struct Rounds {
    std::vector<TradeErrors> errors;
    std::vector<double> seconds;
  };
  std::vector<std::vector<Rounds>> rounds_;      // by method and point
  std::vector<std::vector<TradePicture>> best_;  // by method and round: at the most samples
  render::Layers own_;                           // the set's own, from the first round

  // What the search for answers has measured already.
  struct KnownError {
    TradeSettings settings;
    int samples;
    double error;
  };
  struct KnownCost {
    TradeSettings settings;
    bool is_live;
    PathCost cost;
  };
  std::vector<KnownError> known_errors_;
  std::vector<KnownCost> known_costs_;
  std::optional<MethodRenderer> probing_;  // with these settings
  TradeSettings probed_;
  std::uint32_t needed_ = 0;  // as searched_axes() wants it

  TradeBudget budget_;
  std::optional<TradePhase> probed_phase_;  // of the search, that probes stop at the end of
  std::optional<output::ShareProgress> progress_;
  double last_s_;             // when progress was shown last
  double of_a_method_s_ = 0;  // the longest measurement of a method so far
};

Sweep::Sweep(const TradeOptions& options, TradeFrame& frame, std::ostream& out)
    : options_(options),
      frame_(frame),
      scene_(scene::load_scene(frame.set())),
      device_(render::open_device(options.device)),
      budget_(options.minutes ? std::optional(60 * *options.minutes) : std::nullopt, steady_s(),
              options.answers),
      last_s_(steady_s()) {
  for (const std::string& note : scene_.notes) out << "scene: " << note << std::endl;
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
  TradeSettings own;
  own.estimation = frame_.set().estimation;
  own.lighting = frame_.set().lighting;
  own.lens = frame_.calibration().lens;
  own.adaptive = frame_.set().quality.adaptive;
  own.denoise = frame_.set().quality.denoise;
  MethodRenderer renderer(device_, frame_, scene_, own, options_.scale);
  renderer.begin(own.estimation.seed);
  needed_ = renderer.needed();
  TradeSettings with_photons = own;
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
  rounds_.assign(report_.methods.size(), std::vector<Rounds>(options_.samples.size()));
  best_.resize(report_.methods.size());
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

// Both halves grow together, so that there is a reference whenever time is over.
void Sweep::make_reference() {
  constexpr std::uint32_t beyond_all_rounds = 1u << 20;
  constexpr double step_s = 1;
  std::array<MethodRenderer, 2> halves{renderer_of(0), renderer_of(0)};
  for (std::uint32_t half = 0; half < 2; ++half)
    halves[half].begin(seed(0) + beyond_all_rounds + half);
  const int samples = report_.reference_samples / 2, most = std::max(samples / parts_of_half, 1);
  int done = 0;
  for (int step = 1; done < samples;) {
    const int now = std::min(step, samples - done);
    const double before = steady_s();
    for (MethodRenderer& half : halves) half.add(now);
    done += now;
    worked("reference", 2.0 * now);
    const double took = std::max(steady_s() - before, 1e-6);
    step = std::clamp(static_cast<int>(now * step_s / took), 1, most);
    if (options_.stop.stop_requested() || budget_.is_over(TradePhase::reference, steady_s())) break;
  }
  report_.reference_samples = 2 * done;
  progress_->step_done("reference of " + std::to_string(2 * done) + " samples", steady_s());
  reference_.emplace(halves[0].picture(), halves[1].picture());
  report_.noise = reference_->noise();
  report_.reference = displayed(reference_->picture());
  const auto& added = reference_->picture().added;
  if (std::ranges::all_of(added, [](const glm::vec3& light) { return light == glm::vec3(0); }))
    throw Error(frame_.set().file.string() + ": frame " + std::to_string(report_.frame) +
                ": nothing virtual, removed or relit is seen in it; there is nothing to trade");
}

// Methods take turns, so that a drift of the machine's speed does not favour one of them.
void Sweep::sweep(const std::function<void(const TradeReport&)>& save) {
  const int methods = static_cast<int>(report_.methods.size());
  for (int round = 0; round < options_.rounds; ++round) {
    for (int i = 0; i < methods; ++i) {
      const int turned = (i + round * methods / options_.rounds) % methods;
      const bool is_first = round == 0 && i == 0;  // without the set's own there is no table
      if (is_first || has_time_for_a_method()) measure(static_cast<std::size_t>(turned), round);
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
    const TradePicture picture = at_sweep_size(renderer.picture());
    rounds_[method][i].seconds.push_back(seconds);
    rounds_[method][i].errors.push_back(reference_->errors(picture));
    if (i + 1 == options_.samples.size()) best_[method].push_back(picture);
    worked(name, options_.samples[i]);
  }
  if (round == 0) compare_parts(method, renderer.layers());
  of_a_method_s_ = std::max(of_a_method_s_, steady_s() - before);
  progress_->step_done(
      "round " + std::to_string(round + 1) + " of " + std::to_string(options_.rounds) + ", " + name,
      steady_s());
}

// This relies on the set's own settings being the first method of the first round.
void Sweep::compare_parts(std::size_t method, const render::Layers& layers) {
  if (method == 0) own_ = layers;
  if (report_.plan.methods[method].settings.carried == 0) return;
  std::size_t changed = 0;
  for (std::size_t i = 0; i < layers.composite.size(); ++i)
    changed += layers.composite[i] != own_.composite[i] || layers.diff[i] != own_.diff[i] ||
               layers.mask[i] != own_.mask[i];
  report_.methods[method].changed_pixels = changed;
}

// Makes of the rounds so far what the table and the page show. A method of which a number of
// samples was not measured has no points.
void Sweep::conclude() {
  std::vector<TradePoint*> candidates;
  std::vector<TradeCost> costs;
  report_.unmeasured.clear();
  for (std::size_t m = 0; m < report_.methods.size(); ++m) {
    TradeMethod& method = report_.methods[m];
    if (rounds_[m].back().errors.empty()) {
      report_.unmeasured.push_back(method.name);
      continue;
    }
    method.points.resize(options_.samples.size());
    for (std::size_t i = 0; i < method.points.size(); ++i) {
      TradePoint& point = method.points[i];
      point.samples = options_.samples[i];
      point.seconds = pipeline::quantile(rounds_[m][i].seconds, 0.5);
      point.errors = rms(rounds_[m][i].errors);
      point.within_noise = within_noise(point.errors, report_.noise);
      if (method.changed_pixels) continue;  // features that are not needed are no choice
      candidates.push_back(&point);
      costs.push_back({point.seconds, point.errors.picture.value_or(0)});
    }
    const std::size_t alike = std::min(best_[m].size(), best_[0].size());
    if (alike >= 3)
      method.bias =
          reference_->bias(std::span(best_[m]).first(alike), std::span(best_[0]).first(alike));
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
  const TradePicture picture = renderer.picture();
  TradeCorner corner{name, at, displayed(picture), displayed(at_sweep_size(picture))};
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

// The error of the picture with these settings, as the rms of the rounds.
double Sweep::probe_error(const TradeSettings& settings, const Making& making) {
  TradeSettings probed = settings;
  probed.scale = making.scale;
  probed.denoise = making.denoise;
  probed.adaptive = false;
  for (const KnownError& known : known_errors_)
    if (known.samples == making.samples && known.settings == probed) return known.error;
  stop_if_over();
  if (!probing_ || !(probed_ == probed)) {
    probing_.emplace(device_, frame_, scene_, probed, options_.scale);
    probed_ = probed;
  }
  std::vector<TradeErrors> errors;
  for (int round = 0; round < options_.rounds; ++round) {
    stop_if_over();
    probing_->begin(seed(round));
    probing_->render(making.samples);
    errors.push_back(reference_->errors(at_sweep_size(probing_->picture())));
  }
  const double error = rms(errors).picture.value_or(0);
  known_errors_.push_back({std::move(probed), making.samples, error});
  return error;
}

PathCost Sweep::probe_cost(const TradeSettings& settings, bool is_live) {
  for (const KnownCost& known : known_costs_)
    if (known.is_live == is_live && known.settings == settings) return known.cost;
  stop_if_over();
  PathTimer timer(device_, frame_, scene_, settings);
  known_costs_.push_back({settings, is_live, PathCost(timer, is_live)});
  return known_costs_.back().cost;
}

void Sweep::find_answers() {
  const set::Quality& quality = frame_.set().quality;
  report_.question.fps = options_.fps.value_or(quality.fps > 0 ? quality.fps : 25);
  report_.question.error = options_.error.value_or(TradeQuestion().error);
  const TradeSettings& own = report_.plan.methods.front().settings;
  std::vector<TradeAxis> axes = searched_axes(own, needed_);
  if (!options_.axes.empty())
    std::erase_if(axes, [&](const TradeAxis& axis) {
      return std::ranges::find(options_.axes, axis.name) == options_.axes.end();
    });
  report_.answers = answer(
      report_.question, frame_.set(), own, axes,
      {.error = [this](const TradeSettings& s, const Making& m) { return probe_error(s, m); },
       .cost = [this](const TradeSettings& s, bool is_live) { return probe_cost(s, is_live); },
       .step =
           [this](const std::string& what) {
             stop_if_over();
             worked("search, " + what, 0);
             progress_->step_done("search, " + what, steady_s());
           },
       .limit = [this](std::optional<TradePhase> phase) { probed_phase_ = phase; }});
}

// Checks the options before anything is rendered.
TradeOptions checked(TradeOptions options) {
  if (!(options.scale > 0 && options.scale <= 1))
    throw Error("--scale " + std::to_string(options.scale) + ": must be above 0 and at most 1");
  const auto check_positive = [](const char* name, const std::optional<double>& value) {
    if (value && !(*value > 0 && std::isfinite(*value)))
      throw Error(std::string(name) + " " + std::to_string(*value) + ": must be above 0");
  };
  check_positive("--fps", options.fps);
  check_positive("--error", options.error);
  check_positive("--minutes", options.minutes);
  if (options.rounds < 1)
    throw Error("--rounds " + std::to_string(options.rounds) + ": must be at least 1");
  if (options.samples.empty()) throw Error("--samples: names no number of samples");
  std::ranges::sort(options.samples);
  options.samples.erase(std::unique(options.samples.begin(), options.samples.end()),
                        options.samples.end());
  for (const int samples : options.samples)
    if (samples < 1 || samples > most_samples)
      throw Error("--samples " + std::to_string(samples) + ": must be from 1 to " +
                  std::to_string(most_samples));
  if (!options.reference_samples)
    options.reference_samples = reference_over_most * options.samples.back();
  if (*options.reference_samples < 2)
    throw Error("--reference-samples " + std::to_string(*options.reference_samples) +
                ": must be at least 2, one for each half");
  return options;
}

// The text of an answer's file, as it is also printed on the page.
std::string answer_file(const TradeReport& report, const TradeAnswer& answer) {
  return "# " + set::printable(report.set) + ", " + answer.use + ": " + answer.words +
         ".\n# Found by `previzd trade` on " + report.device +
         ". It takes the place of the set's own keys with --with " +
         answer.file.filename().string() + "\n\n" + answer.toml;
}

fs::path made_directory(const fs::path& directory) {
  std::error_code code;
  fs::create_directories(directory, code);
  if (code || !fs::is_directory(directory))
    throw Error("--out " + directory.string() + ": is not a directory and cannot be made one" +
                (code ? ": " + code.message() : ""));
  return directory;
}

}  // namespace

double parse_share(const std::string& text) {
  const bool is_percent = text.ends_with('%');
  const std::string digits = text.substr(0, text.size() - (is_percent ? 1 : 0));
  double value = 0;
  const auto [end, code] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (digits.empty() || code != std::errc() || end != digits.data() + digits.size() || !(value > 0))
    throw Error("--error " + text + ": write a share above 0, 2% or 0.02");
  return is_percent ? value / 100 : value;
}

TradeReport run_trade(const TradeOptions& given, std::ostream& out) {
  const TradeOptions options = checked(given);
  TradeFrame frame(options.source, options.frame);
  const fs::path directory =
      made_directory(options.directory.value_or(frame.set().output.directory / "trade"));
  const auto save = [&](const TradeReport& report) {
    session::replace_file(directory / "trade.csv", trade_csv(report));
    session::replace_file(directory / "trade.html", trade_page(report));
  };
  TradeReport report = Sweep(options, frame, out).run(out, save);
  if (report.reference.samples.empty()) return report;  // it was stopped before anything was known
  report.csv = directory / "trade.csv";
  report.page = directory / "trade.html";
  for (TradeAnswer& answer : report.answers) {
    const fs::path file = directory / (answer.use + ".toml");
    if (!answer.is_met) {
      fs::remove(file);  // an earlier one, of another question
      continue;
    }
    answer.file = file;
    session::replace_file(file, answer_file(report, answer));
  }
  save(report);
  return report;
}

}  // namespace previz::trade
