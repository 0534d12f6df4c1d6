// Time to an error beside Blender Cycles' shadow catcher, each against its own converged picture,
// and how far each converged picture is from the truth. tests/bench/cycles/run calls it.
#include <algorithm>
#include <cstdio>
#include <optional>
#include <thread>
#include <utility>

#include "drivers/error.hpp"
#include "tests/bench/equal_error/cycles.hpp"
#include "tests/bench/equal_error/reference.hpp"
#include "tests/bench/equal_error/time_to_error.hpp"
#include "tests/bench/measure.hpp"
#include "tests/bench/program.hpp"

namespace previz::bench {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::vector<fs::path> sets;
  fs::path script, out;
  std::optional<int> frame;
  int width = 160;
  int rounds = 3;
  int reference_samples = 2048;
  int cycles_reference_samples = 8192;
  int samples = 512;
  std::vector<double> errors = {0.2, 0.1, 0.05};
};

// A method's way to its converged picture, in one round.
struct Way {
  std::vector<Point> diff, virtual_part;  // e_diff and e_virtual
  void add(double cpu_s, const truth::Measures& measures) {
    diff.push_back({cpu_s, measures.e_diff});
    virtual_part.push_back({cpu_s, measures.e_virtual});
  }
};

std::vector<int> doubling(int most) {
  std::vector<int> samples;
  for (int n = 1; n <= most; n *= 2) samples.push_back(n);
  return samples;
}

Method our_method() {
  Method method{"previzd", {}};
  method.estimation.estimator = set::Estimator::difference;
  return method;
}

// Cycles has no lens distortion: both sides do without it, and cannot be held against the truth.
bool drop_distortion(View& view) {
  PinholeIntrinsics& k = view.camera.intrinsics;
  bool had = false;
  for (double* term : {&k.k1, &k.k2, &k.p1, &k.p2, &k.k3, &k.k4, &k.k5, &k.k6})
    had |= std::exchange(*term, 0) != 0;
  return had;
}

class Comparison {
 public:
  Comparison(const std::shared_ptr<render::Device>& device, const Options& options,
             const fs::path& set);
  void run();

 private:
  Reference cycles_reference();
  Way our_way(std::uint32_t seed);
  Way cycles_way(std::uint32_t seed);
  void print_times(const char* what, std::vector<Point> Way::*points) const;
  void print_bias() const;

  const Options& options_;
  const fs::path set_;
  View view_;
  const bool distorted_;
  const CyclesOptions cycles_;
  const Reference ours_, cycles_converged_;
  MethodRun method_;
  std::vector<Way> our_ways_, cycles_ways_;
};

CyclesOptions cycles_options(const Options& options, const fs::path& set, const View& view) {
  const int threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  return {options.script, set, view.frame, options.width, threads};
}

Comparison::Comparison(const std::shared_ptr<render::Device>& device, const Options& options,
                       const fs::path& set)
    : options_(options),
      set_(set),
      view_(load_view(set, options.frame, options.width)),
      distorted_(drop_distortion(view_)),
      cycles_(cycles_options(options, set, view_)),
      ours_(make_reference(device, view_, our_method(), options.reference_samples)),
      cycles_converged_(cycles_reference()),
      method_(device, view_, our_method()) {}

Reference Comparison::cycles_reference() {
  const auto half = [&](std::uint32_t seed, const char* name) {
    const auto renders = render_with_cycles(cycles_, {options_.cycles_reference_samples / 2}, seed,
                                            options_.out / view_.set / name);
    return read_shadow_catcher(renders.front().file, ours_.frame);
  };
  return reference_of(ours_.frame, half(1'000'001, "reference-a"), half(1'000'002, "reference-b"));
}

Way Comparison::our_way(std::uint32_t seed) {
  Way way;
  method_.begin(seed);
  for (const int samples : doubling(options_.samples)) {
    method_.render(samples - method_.samples());
    way.add(method_.cpu_s(), error_of(ours_, method_.estimate()));
  }
  return way;
}

Way Comparison::cycles_way(std::uint32_t seed) {
  const auto renders =
      render_with_cycles(cycles_, doubling(4 * options_.samples), seed,
                         options_.out / view_.set / ("round-" + std::to_string(seed)));
  Way way;
  for (const CyclesRender& render : renders)
    way.add(render.cpu_s,
            error_of(cycles_converged_, read_shadow_catcher(render.file, cycles_converged_.frame)));
  return way;
}

void Comparison::print_times(const char* what, std::vector<Point> Way::*points) const {
  for (const double error : options_.errors) {
    std::vector<double> ours, cycles, ratios;
    bool beyond = false;
    for (std::size_t i = 0; i < our_ways_.size(); ++i) {
      const TimeToError a = time_to_error(our_ways_[i].*points, error);
      const TimeToError b = time_to_error(cycles_ways_[i].*points, error);
      beyond = beyond || a.is_beyond || b.is_beyond;
      ours.push_back(a.cpu_s);
      cycles.push_back(b.cpu_s);
      ratios.push_back(b.cpu_s / a.cpu_s);
    }
    const auto [low, high] = std::ranges::minmax(ratios);
    std::printf("| %s | %.3g %%%s | %.3g | %.3g | %.1f | %.1f to %.1f |\n", what, 100 * error,
                beyond ? " *" : "", median(ours), median(cycles), median(ratios), low, high);
  }
}

// Means of `factor`^2 pixels.
template <class T>
std::vector<T> reduced(const std::vector<T>& picture, int width, int height, int factor) {
  std::vector<T> out;
  for (int y = 0; y < height; y += factor)
    for (int x = 0; x < width; x += factor) {
      T sum(0);
      for (int v = y; v < y + factor; ++v)
        for (int u = x; u < x + factor; ++u)
          sum += picture[static_cast<std::size_t>(v) * static_cast<std::size_t>(width) +
                         static_cast<std::size_t>(u)];
      out.push_back(sum / static_cast<float>(factor * factor));
    }
  return out;
}

// Both converged pictures against the truth, where its picture can be brought to their size.
void Comparison::print_bias() const {
  const truth::TruthSet set = truth::load_truth_set(set_);
  truth::TruthFrame full = truth::load_truth_frame(set, view_.frame);
  const int factor = full.width / options_.width;
  if (distorted_ || factor * options_.width != full.width ||
      factor * ours_.frame.height != full.height) {
    std::printf(
        "\nThe converged pictures are not compared with the truth: its lens distorts, or "
        "its picture is no multiple of this one.\n");
    return;
  }
  Reference truth{ours_.frame, {}};
  truth.frame.mixed = reduced(full.mixed, full.width, full.height, factor);
  truth.frame.real = truth.frame.plate = reduced(full.real, full.width, full.height, factor);
  truth.frame.mask = reduced(full.mask, full.width, full.height, factor);
  const auto print = [&](const char* name, const Reference& converged) {
    truth::EstimatedFrame estimate;
    estimate.mask = converged.frame.mask;
    estimate.mixed = converged.frame.mixed;
    estimate.real = converged.frame.real;
    for (std::size_t i = 0; i < estimate.mask.size(); ++i)
      estimate.diff.push_back(estimate.mixed[i] - estimate.real[i]);
    const truth::Measures m = error_of(truth, estimate);
    std::printf("| %s | %.4f | %.4f | %+.4f | %.4f | %.4f | %+.4f |\n", name, m.e_diff,
                converged.noise.e_diff, m.bias_diff, m.e_virtual, converged.noise.e_virtual,
                m.bias_virtual);
  };
  std::printf(
      "\nConverged pictures against the truth: error, its own noise, signed error\n\n"
      "| | difference | noise | bias | virtual objects | noise | bias |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n");
  print("previzd", ours_);
  print("Cycles", cycles_converged_);
}

void Comparison::run() {
  for (int round = 1; round <= options_.rounds; ++round) {
    our_ways_.push_back(our_way(static_cast<std::uint32_t>(round)));
    cycles_ways_.push_back(cycles_way(static_cast<std::uint32_t>(round)));
  }
  std::printf(
      "\n%s, frame %d, %dx%d, %d threads. CPU seconds to an error; * beyond what was "
      "measured in some round\n\n"
      "| error of | error | previzd, s | Cycles, s | Cycles / previzd | spread |\n"
      "| --- | --- | --- | --- | --- | --- |\n",
      view_.set.c_str(), view_.frame, ours_.frame.width, ours_.frame.height, cycles_.threads);
  print_times("difference", &Way::diff);
  print_times("virtual objects", &Way::virtual_part);
  print_bias();
  std::fflush(stdout);
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  previz::bench::Options options;
  CLI::App app("CPU time to an error, beside Blender Cycles' shadow catcher");
  app.add_option("SETDIR", options.sets, "Ground truth sets")->required();
  app.add_option("--script", options.script, "shadow_catcher.py")->required();
  app.add_option("--out", options.out, "Folder for what Blender renders")->required();
  app.add_option("--frame", options.frame, "Truth frame [the first]");
  app.add_option("--width", options.width, "Pixels");
  app.add_option("--rounds", options.rounds, "With random numbers of their own");
  app.add_option("--reference", options.reference_samples, "Samples of our converged picture");
  app.add_option("--cycles-reference", options.cycles_reference_samples, "Samples of Cycles'");
  app.add_option("--samples", options.samples, "Up to these; Cycles up to four times as many");
  app.add_option("--error", options.errors, "Shares, as 0.1");
  return previz::bench::run_program(app, argc, argv, [&] {
    const auto device = previz::render::open_device();
    for (const auto& set : options.sets) previz::bench::Comparison(device, options, set).run();
  });
}
