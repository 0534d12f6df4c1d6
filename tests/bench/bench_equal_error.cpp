// Measures how much CPU time the forms of the difference estimator need to reach the same error of
// the difference image, complete and with one technique left out (tests/truth/README.md,
// "Equal-error time"). Methods take turns within a round; rounds have random numbers of their own.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/set/names.hpp"
#include "drivers/error.hpp"
#include "tests/bench/equal_error/reference.hpp"
#include "tests/bench/equal_error/time_to_error.hpp"
#include "tests/bench/measure.hpp"
#include "tests/bench/program.hpp"

namespace previz::bench {
namespace {

struct Options {
  std::vector<std::filesystem::path> sets;
  std::optional<int> frame;
  int width = 160;
  double error = 0.1;
  int rounds = 3;
  int reference_samples = 1024;
  int samples = 0;  // of a round; 0: until the error is reached
  double limit_s = 60;
  std::vector<std::string> methods;
  set::LightMode light = set::LightMode::image;
};

// The first is what the others are compared with.
std::vector<Method> all_methods() {
  const auto method = [](const std::string& name, set::Estimator estimator, double bounds,
                         set::Caustics caustics) {
    Method result{name, {}};
    result.estimation.estimator = estimator;
    result.estimation.difference_sampling = bounds;
    result.estimation.caustics = caustics;
    return result;
  };
  constexpr set::Estimator difference = set::Estimator::difference;
  constexpr set::Estimator paired = set::Estimator::paired;
  constexpr set::Caustics photons = set::Caustics::photons;
  const double bounds = set::Estimation{}.difference_sampling;
  std::vector<Method> methods = {
      method("difference", difference, bounds, photons),
      method("paired", paired, bounds, photons),
      method("difference, no bounds", difference, 0, photons),
      method("paper", paired, 0, photons),
      method("difference, caustics traced", difference, bounds, set::Caustics::traced),
      method("paper, caustics traced", paired, 0, set::Caustics::traced),
  };
  methods.push_back(method("difference, adaptive", difference, bounds, photons));
  methods.back().adaptive = true;
  methods.push_back(method("difference, denoised", difference, bounds, photons));
  methods.back().denoise = true;
  methods.push_back(method("paper, denoised", paired, 0, photons));
  methods.back().denoise = true;
  methods.push_back(method("paper, light by BSDF", paired, 0, photons));
  methods.back().sampling = set::LightSampling::bsdf;
  methods.push_back(method("two renders", paired, 0, photons));
  methods.back().separate = true;
  return methods;
}

std::vector<Method> chosen_methods(const std::vector<std::string>& names) {
  std::vector<Method> all = all_methods();
  if (names.empty()) return all;
  std::vector<Method> methods;
  for (const std::string& name : names) {
    const auto found = std::ranges::find(all, name, &Method::name);
    if (found == all.end()) throw Error("there is no method '" + name + "'");
    methods.push_back(*found);
  }
  return methods;
}

struct Result {
  std::vector<double> seconds;               // to the error, of each round
  bool is_beyond = false;                    // some round did not measure there
  double rays = 0, shadow_rays = 0, ns = 0;  // of a sample of a pixel
  double samples = 0;                        // of the last round
  double bias = 0;                           // signed error over the signal, mean over rounds
};

// Independent noise: what is left of the squared error without the reference's own.
double without(double error, double noise) {
  return std::sqrt(std::max(error * error - noise * noise, 1e-12));
}

void measure(MethodRun& run, std::uint32_t seed, const Reference& reference, const Options& options,
             Result& result) {
  std::vector<Point> points;
  truth::Measures measures;
  run.begin(seed);
  const auto render = [&](int samples) {
    run.render(samples);
    measures = error_of(reference, run.estimate());
    points.push_back({run.cpu_s(), without(measures.e_diff, reference.noise.e_diff)});
  };
  if (options.samples > 0) {
    render(options.samples);
  } else {
    do {
      render(std::max(run.samples(), 1));
    } while (points.back().error > options.error && 2 * run.cpu_s() < options.limit_s);
  }
  const render::Counters counters = run.counters();
  const double samples = 1.0 * run.samples() * reference.frame.width * reference.frame.height;
  result.rays = static_cast<double>(counters.rays) / samples;
  result.shadow_rays = static_cast<double>(counters.shadow_rays) / samples;
  result.ns = 1e9 * run.cpu_s() / samples;
  result.samples = run.samples();
  result.bias += measures.bias_diff / options.rounds;
  const TimeToError time = time_to_error(points, options.error);
  result.is_beyond = result.is_beyond || time.is_beyond;
  result.seconds.push_back(time.cpu_s);
}

// Of rounds: the median of times that were measured, the mean of those that follow from an error.
double middle(const std::vector<double>& values, const Options& options) {
  return options.samples > 0 ? mean(values) : median(values);
}

void print(const std::vector<Method>& methods, const std::vector<Result>& results,
           const Options& options) {
  std::printf(
      "| method | CPU s | over the first | spread | rays | shadow rays | ns | samples | bias |\n"
      "| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n");
  for (std::size_t m = 0; m < methods.size(); ++m) {
    const Result& r = results[m];
    std::vector<double> ratios;
    for (std::size_t i = 0; i < r.seconds.size(); ++i)
      ratios.push_back(r.seconds[i] / results[0].seconds[i]);
    const auto [low, high] = std::ranges::minmax(ratios);
    const double ratio =
        options.samples > 0 ? mean(r.seconds) / mean(results[0].seconds) : median(ratios);
    std::printf("| %s | %.3g%s | %.2f | %.2f to %.2f | %.2f | %.2f | %.0f | %.0f | %+.3f |\n",
                methods[m].name.c_str(), middle(r.seconds, options), r.is_beyond ? " *" : "", ratio,
                low, high, r.rays, r.shadow_rays, r.ns, r.samples, r.bias);
  }
  std::printf("\n");
  std::fflush(stdout);
}

void run(const Options& options) {
  const auto device = render::open_device();
  const std::vector<Method> methods = chosen_methods(options.methods);
  if (options.samples > 0 && std::ranges::any_of(methods, &Method::denoise))
    throw Error(
        "--samples: the error of what is denoised does not fall as noise does; name methods");
  for (const std::filesystem::path& directory : options.sets) {
    const View view = load_view(directory, options.frame, options.width, options.light);
    const Reference reference =
        make_reference(device, view, all_methods().front(), options.reference_samples);
    std::printf(
        "%s, frame %d, %dx%d, light: %s (%zu lamps). To %.3g %% of the difference over %d "
        "blocks; the reference's own error, taken off: %.2g %%. * beyond what was measured "
        "in some round. Rays, ns: of a sample of a pixel.\n\n",
        view.set.c_str(), view.frame, reference.frame.width, reference.frame.height,
        set::name_of(options.light), view.lamps.size(), 100 * options.error,
        reference.noise.diff_blocks, 100 * reference.noise.e_diff);
    std::vector<std::unique_ptr<MethodRun>> runs;
    for (const Method& method : methods)
      runs.push_back(std::make_unique<MethodRun>(device, view, method));
    std::vector<Result> results(methods.size());
    for (int round = 1; round <= options.rounds; ++round)
      for (std::size_t m = 0; m < methods.size(); ++m)
        measure(*runs[m], static_cast<std::uint32_t>(round), reference, options, results[m]);
    print(methods, results, options);
  }
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  using previz::set::LightMode;
  previz::bench::Options options;
  CLI::App app("CPU time to an error of the difference image");
  app.add_option("SETDIR", options.sets, "Ground truth sets")->required();
  app.add_option("--frame", options.frame, "Truth frame [the first]");
  app.add_option("--width", options.width, "Pixels; 800 for the paper's figure");
  app.add_option("--error", options.error, "A share, as 0.05");
  app.add_option("--rounds", options.rounds, "With random numbers of their own");
  app.add_option("--reference", options.reference_samples, "Its samples, in two halves");
  app.add_option("--samples", options.samples,
                 "Of a round, from whose error the time follows [until the error is reached]")
      ->check(CLI::PositiveNumber);
  app.add_option("--limit", options.limit_s, "CPU seconds of a method and round");
  app.add_option("--method", options.methods, "Only these, compared with the first; repeatable")
      ->allow_extra_args(false);
  app.add_option("--light", options.light, "image, sources or hybrid, as lighting.mode")
      ->transform(
          CLI::CheckedTransformer(std::map<std::string, LightMode>{{"image", LightMode::image},
                                                                   {"sources", LightMode::sources},
                                                                   {"hybrid", LightMode::hybrid}}));
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::run(options); });
}
