// How much less time the difference estimator needs than other ways to the same error of the
// difference image (accuracy.md, "Equal-error time"). Methods take turns within a round; rounds
// have random numbers of their own.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tests/bench/equal_error/reference.hpp"
#include "tests/bench/equal_error/time_to_error.hpp"
#include "tests/bench/measure.hpp"

namespace previz::bench {
namespace {

struct Options {
  std::vector<std::filesystem::path> sets;
  std::optional<int> frame;
  int width = 160;
  double error = 0.1;
  int rounds = 5;
  int reference_samples = 4096;
  double limit_s = 120;
  std::vector<std::string> methods;
};

// The first is what the others are compared with. An ablation of it lacks one of its techniques.
std::vector<Method> all_methods() {
  set::Estimation difference;
  difference.estimator = set::Estimator::difference;
  const auto changed = [&](const std::string& name, const auto& change) {
    Method method{name, difference};
    change(method);
    return method;
  };
  constexpr set::Estimator paired = set::Estimator::paired;
  return {
      {"difference", difference},
      changed("paired", [](Method& m) { m.estimation.estimator = paired; }),
      changed("paper's paired",
              [](Method& m) {
                m.estimation.estimator = paired;
                m.estimation.difference_sampling = 0;
              }),
      changed("two renders", [](Method& m) { m.separate = true; }),
      changed("difference without bounds", [](Method& m) { m.estimation.difference_sampling = 0; }),
      changed("difference without photons",
              [](Method& m) { m.estimation.caustics = set::Caustics::traced; }),
      changed("paper's paired without photons",
              [](Method& m) {
                m.estimation.estimator = paired;
                m.estimation.difference_sampling = 0;
                m.estimation.caustics = set::Caustics::traced;
              }),
  };
}

std::vector<Method> chosen_methods(const std::vector<std::string>& names) {
  std::vector<Method> methods = all_methods();
  if (!names.empty())
    std::erase_if(methods, [&](const Method& m) { return std::ranges::count(names, m.name) == 0; });
  return methods;
}

struct Result {
  std::vector<double> seconds;  // to the error, of each round
  bool extrapolated = false;
  double rays = 0, shadow_rays = 0;  // a pixel's sample
  double samples_per_s = 0;          // of all pixels, per second
  double bias = 0;
  double samples = 0;
};

void measure(MethodRun& run, std::uint32_t seed, const Reference& reference, const Options& options,
             Result& result) {
  std::vector<Point> points;
  run.begin(seed);
  for (int samples = 1;; samples *= 2) {
    run.render(samples - run.samples());
    const truth::Measures measures = error_of(reference, run.estimate());
    points.push_back({run.cpu_s(), measures.e_diff});
    result.bias = measures.bias_diff;
    if (measures.e_diff <= options.error || run.cpu_s() * 2 > options.limit_s) break;
  }
  const render::Counters counters = run.counters();
  const double pixel_samples =
      static_cast<double>(run.samples()) * reference.frame.width * reference.frame.height;
  result.rays = static_cast<double>(counters.rays) / pixel_samples;
  result.shadow_rays = static_cast<double>(counters.shadow_rays) / pixel_samples;
  result.samples_per_s = run.samples() / run.cpu_s();
  result.samples = run.samples();
  const TimeToError time = time_to_error(points, options.error);
  result.extrapolated = result.extrapolated || time.is_beyond;
  result.seconds.push_back(time.cpu_s);
}

void print(const View& view, const std::vector<Method>& methods,
           const std::vector<Result>& results) {
  for (std::size_t m = 0; m < methods.size(); ++m) {
    std::vector<double> ratios;
    for (std::size_t i = 0; i < results[m].seconds.size(); ++i)
      ratios.push_back(results[m].seconds[i] / results[0].seconds[i]);
    const auto [low, high] = std::ranges::minmax(ratios);
    std::printf("| %s %d | %s | %s%.3g | %.2f | %.2f to %.2f | %.2f | %.2f | %.3g | %.0f | %.3f\n",
                view.set.c_str(), view.frame, methods[m].name.c_str(),
                results[m].extrapolated ? "~" : "", median(results[m].seconds), median(ratios), low,
                high, results[m].rays, results[m].shadow_rays,
                1e9 / results[m].samples_per_s /
                    (view.camera.intrinsics.width * view.camera.intrinsics.height),
                results[m].samples, results[m].bias);
  }
  std::fflush(stdout);
}

void run(const Options& options) {
  const auto device = render::open_device();
  const std::vector<Method> methods = chosen_methods(options.methods);
  for (const std::filesystem::path& directory : options.sets) {
    const View view = load_view(directory, options.frame, options.width);
    const Reference reference =
        make_reference(device, view, all_methods().front(), options.reference_samples);
    std::printf("reference of %s: e_diff %.4f over %d blocks\n", view.set.c_str(),
                reference.noise.e_diff, reference.noise.diff_blocks);
    std::vector<std::unique_ptr<MethodRun>> runs;
    for (const Method& method : methods)
      runs.push_back(std::make_unique<MethodRun>(device, view, method));
    std::vector<Result> results(methods.size());
    for (int round = 1; round <= options.rounds; ++round)
      for (std::size_t m = 0; m < methods.size(); ++m)
        measure(*runs[m], static_cast<std::uint32_t>(round), reference, options, results[m]);
    print(view, methods, results);
  }
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  previz::bench::Options options;
  CLI::App app("CPU time to an error of the difference image");
  app.add_option("SETDIR", options.sets)->required();
  app.add_option("--frame", options.frame);
  app.add_option("--width", options.width);
  app.add_option("--error", options.error);
  app.add_option("--rounds", options.rounds);
  app.add_option("--reference", options.reference_samples);
  app.add_option("--limit", options.limit_s);
  app.add_option("--method", options.methods);
  CLI11_PARSE(app, argc, argv);
  try {
    previz::bench::run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_equal_error: %s\n", error.what());
    return 1;
  }
}
