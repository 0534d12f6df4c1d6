// How many samples, and how much time, light sources save: the error of the difference image with
// the light around a truth set as an image, sampled as in the paper (by the BSDF alone) and by
// importance, and with its sources as lamps. Each kind of light against its own reference.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/set/names.hpp"
#include "tests/bench/equal_error/reference.hpp"
#include "tests/bench/equal_error/time_to_error.hpp"
#include "tests/bench/measure.hpp"
#include "tests/bench/program.hpp"
#include "tests/truth/compare.hpp"

namespace previz::bench {
namespace {

struct Options {
  std::filesystem::path set;
  std::optional<int> frame;
  int width = 160;
  int rounds = 3;
  int samples = 256;         // the most of every method
  int paper_samples = 1024;  // of the paper's
  int reference_samples = 4096;
};

struct LightPoint {
  int samples = 0;
  double cpu_s = 0, e_diff = 0, e_virtual = 0;
};

struct LitMethod {
  set::LightMode light;
  Method method;
};

std::vector<LitMethod> light_methods() {
  set::Estimation estimation;
  estimation.estimator = set::Estimator::difference;
  using enum set::LightMode;
  return {{image, {"image, by the BSDF", estimation, false, set::LightSampling::bsdf}},
          {image, {"image, by importance", estimation}},
          {sources, {"sources", estimation}},
          {hybrid, {"hybrid", estimation}}};
}

// A method on its way down, with what it is measured against.
struct Way {
  Method method;
  std::shared_ptr<const Reference> reference;
  std::unique_ptr<MethodRun> run;
  int most = 0;  // samples
  std::vector<std::vector<LightPoint>> rounds = {};

  void measure(std::uint32_t seed) {
    std::vector<LightPoint>& points = rounds.emplace_back();
    run->begin(seed);
    for (int samples = 1; samples <= most; samples *= 4) {
      run->render(samples - run->samples());
      const truth::Measures measures = error_of(*reference, run->estimate());
      points.push_back({samples, run->cpu_s(), measures.e_diff, measures.e_virtual});
    }
  }

  std::vector<LightPoint> medians() const {
    std::vector<LightPoint> result = rounds.front();
    for (std::size_t i = 0; i < result.size(); ++i)
      for (double LightPoint::*value :
           {&LightPoint::cpu_s, &LightPoint::e_diff, &LightPoint::e_virtual}) {
        std::vector<double> values;
        for (const auto& round : rounds) values.push_back(round[i].*value);
        result[i].*value = median(values);
      }
    return result;
  }
};

// The two ways to sample the image have one reference.
std::vector<Way> make_ways(const std::shared_ptr<render::Device>& device, const Options& options) {
  std::vector<Way> ways;
  for (const auto& [mode, method] : light_methods()) {
    const View view = load_view(options.set, options.frame, options.width, mode);
    const bool is_paper = method.sampling == set::LightSampling::bsdf;
    std::shared_ptr<const Reference> reference;
    if (!is_paper && mode == set::LightMode::image) {
      reference = ways.front().reference;
    } else {
      Method light = method;
      light.sampling = set::LightSampling::importance;
      reference = std::make_shared<Reference>(
          make_reference(device, view, light, options.reference_samples));
      std::printf("reference, %s: e_diff %.4f, e_virtual %.4f\n", set::name_of(mode),
                  reference->noise.e_diff, reference->noise.e_virtual);
      std::fflush(stdout);
    }
    ways.push_back({method, reference, std::make_unique<MethodRun>(device, view, method),
                    is_paper ? options.paper_samples : options.samples});
  }
  return ways;
}

// What a method needs for an error, by samples and by time.
void print_saving(const std::string& name, const std::vector<LightPoint>& way,
                  const LightPoint& paper) {
  std::vector<Point> by_samples, by_time;
  for (const LightPoint& point : way) {
    by_samples.push_back({1.0 * point.samples, point.e_diff});
    by_time.push_back({point.cpu_s, point.e_diff});
  }
  const TimeToError samples = time_to_error(by_samples, paper.e_diff);
  const TimeToError seconds = time_to_error(by_time, paper.e_diff);
  std::printf("%s: %s%.3g samples in %.3g s: %.3g and %.3g times less\n", name.c_str(),
              samples.is_beyond ? "about " : "", samples.cpu_s, seconds.cpu_s,
              paper.samples / samples.cpu_s, paper.cpu_s / seconds.cpu_s);
}

void run_light(const Options& options) {
  const auto device = render::open_device();
  const View view = load_view(options.set, options.frame, options.width);
  std::printf("%s, frame %d, %dx%d\n", view.set.c_str(), view.frame, view.camera.intrinsics.width,
              view.camera.intrinsics.height);
  std::vector<Way> ways = make_ways(device, options);
  for (int round = 1; round <= options.rounds; ++round)
    for (Way& way : ways) way.measure(static_cast<std::uint32_t>(round));
  std::printf(
      "\n| light | samples | CPU s | e_diff | e_virtual |\n| --- | --- | --- | --- | --- |\n");
  for (const Way& way : ways)
    for (const LightPoint& p : way.medians())
      std::printf("| %s | %d | %.3g | %.4f | %.4f |\n", way.method.name.c_str(), p.samples, p.cpu_s,
                  p.e_diff, p.e_virtual);
  const LightPoint paper = ways.front().medians().back();
  std::printf("\nThe paper's way: e_diff %.3f with %d samples in %.3g s. The others:\n",
              paper.e_diff, paper.samples, paper.cpu_s);
  for (std::size_t i = 1; i < ways.size(); ++i)
    print_saving(ways[i].method.name, ways[i].medians(), paper);
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  previz::bench::Options options;
  CLI::App app("Error of the difference image by what the light around a set is made into");
  app.add_option("SETDIR", options.set)->required();
  app.add_option("--frame", options.frame);
  app.add_option("--width", options.width);
  app.add_option("--rounds", options.rounds);
  app.add_option("--samples", options.samples, "the most of every method but the paper's");
  app.add_option("--paper-samples", options.paper_samples);
  app.add_option("--reference", options.reference_samples);
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::run_light(options); });
}
