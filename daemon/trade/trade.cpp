#include "daemon/trade/trade.hpp"

#include <algorithm>
#include <chrono>
#include <numeric>
#include <ostream>
#include <utility>

#include "daemon/output/progress.hpp"
#include "daemon/pipeline/metrics.hpp"
#include "daemon/pipeline/preview_size.hpp"
#include "daemon/scene/scene.hpp"
#include "daemon/trade/frame.hpp"
#include "daemon/trade/method.hpp"
#include "daemon/trade/page.hpp"
#include "drivers/error.hpp"
#include "drivers/session/files.hpp"

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
  TradeReport run(std::ostream& out);

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
  TradePicture reference_half(int half, output::ShareProgress& progress) const;
  void measure(std::size_t method, int round, output::ShareProgress& progress);
  void compare_parts(std::size_t method, const render::Layers& layers);
  void conclude();
  void find_corners(output::ShareProgress& progress);
  TradeCorner corner(const std::string& name, const TradeFrontPoint& at) const;
  Plate displayed(const TradePicture& picture) const;
  void stop_if_asked() const {
    if (options_.stop.stop_requested()) throw Stopped();
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
};

Sweep::Sweep(const TradeOptions& options, TradeFrame& frame, std::ostream& out)
    : options_(options),
      frame_(frame),
      scene_(scene::load_scene(frame.set())),
      device_(render::open_device(options.device)) {
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
  report_.plan = plan_trade(own, trade_axes(own, renderer.needed()), options_.axes);

  for (const TradePlan::Method& method : report_.plan.methods) {
    TradeMethod& measured = report_.methods.emplace_back();
    measured.name = method.name;
    for (const int samples : options_.samples) measured.points.emplace_back().samples = samples;
  }
  rounds_.assign(report_.methods.size(), std::vector<Rounds>(options_.samples.size()));
  best_.resize(report_.methods.size());
}

TradeReport Sweep::run(std::ostream& out) {
  const int methods = static_cast<int>(report_.methods.size());
  const int once = std::reduce(options_.samples.begin(), options_.samples.end()) + 1;
  const int corners = 3 * options_.samples.back();
  const double work = report_.reference_samples + 1.0 * methods * options_.rounds * once + corners;
  output::ShareProgress progress(out, options_.terminal, work, steady_s());
  out << report_.set << ": frame " << report_.frame << " at " << report_.width << "x"
      << report_.height << ", " << methods << " variants on " << report_.plan.axes.size()
      << " axes, reference of " << report_.reference_samples << " samples, on " << report_.device
      << std::endl;

  const TradePicture half = reference_half(0, progress);
  reference_.emplace(half, reference_half(1, progress));
  report_.noise = reference_->noise();
  report_.reference = displayed(reference_->picture());
  const auto& added = reference_->picture().added;
  if (std::ranges::all_of(added, [](const glm::vec3& light) { return light == glm::vec3(0); }))
    throw Error(frame_.set().file.string() + ": frame " + std::to_string(report_.frame) +
                ": nothing virtual, removed or relit is seen in it; there is nothing to trade");

  // Methods take turns, so that a drift of the machine's speed does not favour one of them.
  for (int round = 0; round < options_.rounds; ++round)
    for (int i = 0; i < methods; ++i) {
      const int turned = (i + round * methods / options_.rounds) % methods;
      measure(static_cast<std::size_t>(turned), round, progress);
    }
  conclude();
  find_corners(progress);
  return std::move(report_);
}

TradePicture Sweep::reference_half(int half, output::ShareProgress& progress) const {
  constexpr std::uint32_t beyond_all_rounds = 1u << 20;
  MethodRenderer renderer = renderer_of(0);
  renderer.begin(seed(0) + beyond_all_rounds + static_cast<std::uint32_t>(half));
  const std::string name = "reference, half " + std::to_string(half + 1) + " of 2";
  const int samples = report_.reference_samples / 2;
  for (int done = 0; done < samples;) {
    const int now = std::min(std::max(samples / parts_of_half, 1), samples - done);
    renderer.add(now);
    stop_if_asked();
    done += now;
    progress.worked(name, now, steady_s());
  }
  progress.step_done(name, steady_s());
  return renderer.picture();
}

void Sweep::measure(std::size_t method, int round, output::ShareProgress& progress) {
  TradeMethod& measured = report_.methods[method];
  MethodRenderer renderer = renderer_of(method);
  renderer.warm_up();
  progress.worked(measured.name, 1, steady_s());
  for (std::size_t i = 0; i < measured.points.size(); ++i) {
    TradePoint& point = measured.points[i];
    renderer.begin(seed(round));
    rounds_[method][i].seconds.push_back(renderer.render(point.samples));
    stop_if_asked();
    const TradePicture picture = at_sweep_size(renderer.picture());
    rounds_[method][i].errors.push_back(reference_->errors(picture));
    if (i + 1 == measured.points.size()) best_[method].push_back(picture);
    progress.worked(measured.name, point.samples, steady_s());
  }
  if (round == 0) compare_parts(method, renderer.layers());
  progress.step_done("round " + std::to_string(round + 1) + " of " +
                         std::to_string(options_.rounds) + ", " + measured.name,
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

void Sweep::conclude() {
  std::vector<TradePoint*> candidates;
  std::vector<TradeCost> costs;
  for (std::size_t m = 0; m < report_.methods.size(); ++m) {
    TradeMethod& method = report_.methods[m];
    for (std::size_t i = 0; i < method.points.size(); ++i) {
      TradePoint& point = method.points[i];
      point.seconds = pipeline::quantile(rounds_[m][i].seconds, 0.5);
      point.errors = rms(rounds_[m][i].errors);
      point.within_noise = within_noise(point.errors, report_.noise);
      if (method.changed_pixels) continue;  // features that are not needed are no choice
      candidates.push_back(&point);
      costs.push_back({point.seconds, point.errors.picture.value_or(0)});
    }
    if (best_[m].size() >= 3) method.bias = reference_->bias(best_[m], best_[0]);
  }
  const std::vector<bool> front = pareto_front(costs);
  for (std::size_t i = 0; i < front.size(); ++i) candidates[i]->pareto = front[i];
}

void Sweep::find_corners(output::ShareProgress& progress) {
  const std::vector<TradeFrontPoint> front = front_of(report_);
  std::vector<TradeCost> costs;
  for (const TradeFrontPoint& at : front)
    costs.push_back({report_.point(at).seconds, report_.point(at).errors.picture.value_or(0)});
  const auto add = [&](const char* name, const TradeFrontPoint& at) {
    stop_if_asked();
    report_.corners.push_back(corner(name, at));
    progress.worked(name, options_.samples.back(), steady_s());
  };
  add("fastest", front.front());
  const std::size_t bend = knee(costs);
  if (bend > 0 && bend + 1 < front.size()) add("knee", front[bend]);
  if (front.size() > 1) add("best", front.back());
  progress.step_done("pictures at the corners", steady_s());
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

// Checks the options before anything is rendered.
TradeOptions checked(TradeOptions options) {
  if (!(options.scale > 0 && options.scale <= 1))
    throw Error("--scale " + std::to_string(options.scale) + ": must be above 0 and at most 1");
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

fs::path made_directory(const fs::path& directory) {
  std::error_code code;
  fs::create_directories(directory, code);
  if (code || !fs::is_directory(directory))
    throw Error("--out " + directory.string() + ": is not a directory and cannot be made one" +
                (code ? ": " + code.message() : ""));
  return directory;
}

}  // namespace

TradeReport run_trade(const TradeOptions& given, std::ostream& out) {
  const TradeOptions options = checked(given);
  TradeFrame frame(options.set_file, options.frame);
  const fs::path directory =
      made_directory(options.directory.value_or(frame.set().output.directory / "trade"));
  TradeReport report;
  try {
    report = Sweep(options, frame, out).run(out);
  } catch (const Stopped&) {
    report.interrupted = true;
    return report;
  }
  report.csv = directory / "trade.csv";
  report.page = directory / "trade.html";
  session::replace_file(report.csv, trade_csv(report));
  session::replace_file(report.page, trade_page(report));
  return report;
}

}  // namespace previz::trade
