// Time to an error beside Blender Cycles' shadow catcher, each against its own converged picture,
// how far the converged pictures are from each other, and from the truth where the set has it.
// tests/bench/cycles/run calls it.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <optional>
#include <thread>
#include <utility>

#include "daemon/core/output/png.hpp"
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
  std::vector<std::string> blenders = {"blender"};
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
  std::vector<int> samples;
  std::vector<Point> diff, virtual_part;  // e_diff and e_virtual
  void add(int count, double cpu_s, const truth::Measures& measures) {
    samples.push_back(count);
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

bool has_mirror(const scene::Material& m) {
  const double alpha = static_cast<double>(m.roughness) * static_cast<double>(m.roughness);
  const bool reflects = m.metallic > 0 || m.transmission > 0 || m.specular > 0;
  return reflects && alpha <= set::Estimation().specular_roughness;
}

// What one program did with a set.
struct Contestant {
  std::string name;
  CyclesOptions cycles;  // without meaning for previzd
  Reference converged;
  std::vector<Way> ways;  // one a round
};

// CPU time of a Cycles to an error of the difference, over ours: the median of the rounds.
struct Ratio {
  std::string set, program;
  bool has_caustics = false;
  std::vector<double> at;  // each of Options::errors
};

class Comparison {
 public:
  Comparison(const std::shared_ptr<render::Device>& device, const Options& options,
             const fs::path& set);
  // Returns the ratios of the difference, one for each Blender.
  std::vector<Ratio> run();
  void write_points(std::ofstream& csv) const;

 private:
  template <class Work>
  auto told(const std::string& what, const Work& work) const;
  Reference cycles_reference(const Contestant& cycles) const;
  Way our_way(std::uint32_t seed);
  Way cycles_way(const Contestant& cycles, std::uint32_t seed) const;
  fs::path directory_of(const Contestant& cycles) const;
  std::vector<double> print_times(const char* what, std::vector<Point> Way::*points,
                                  const Contestant& cycles) const;
  void print_agreement(const Contestant& cycles) const;
  void print_bias() const;

  const Options& options_;
  const fs::path set_;
  View view_;
  const bool distorted_;
  Contestant ours_;
  std::vector<Contestant> cycles_;
  MethodRun method_;
};

// Says on standard error what is under way, and how long it took.
template <class Work>
auto Comparison::told(const std::string& what, const Work& work) const {
  std::fprintf(stderr, "%s, %s ...", view_.set.c_str(), what.c_str());
  const auto start = std::chrono::steady_clock::now();
  auto result = work();
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  std::fprintf(stderr, " %.0f s\n", seconds.count());
  return result;
}

Comparison::Comparison(const std::shared_ptr<render::Device>& device, const Options& options,
                       const fs::path& set)
    : options_(options),
      set_(set),
      view_(load_view(set, options.frame, options.width)),
      distorted_(drop_distortion(view_)),
      ours_{"previzd", {}, {}, {}},
      method_(device, view_, our_method()) {
  ours_.converged = told("previzd converges", [&] {
    return make_reference(device, view_, our_method(), options.reference_samples);
  });
  const int threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  for (const std::string& blender : options.blenders) {
    Contestant cycles{blender_version(blender),
                      {blender, options.script, set, view_.frame, options.width, threads},
                      {},
                      {}};
    cycles.converged = told(cycles.name + " converges", [&] { return cycles_reference(cycles); });
    cycles_.push_back(std::move(cycles));
  }
}

fs::path Comparison::directory_of(const Contestant& cycles) const {
  return options_.out / view_.set / cycles.name;
}

Reference Comparison::cycles_reference(const Contestant& cycles) const {
  const auto half = [&](std::uint32_t seed, const char* name) {
    const auto renders = render_with_cycles(cycles.cycles, {options_.cycles_reference_samples / 2},
                                            seed, directory_of(cycles) / name);
    return read_shadow_catcher(renders.front().file, ours_.converged.frame);
  };
  return reference_of(ours_.converged.frame, half(1'000'001, "reference-a"),
                      half(1'000'002, "reference-b"));
}

Way Comparison::our_way(std::uint32_t seed) {
  Way way;
  method_.begin(seed);
  for (const int samples : doubling(options_.samples)) {
    method_.render(samples - method_.samples());
    way.add(samples, method_.cpu_s(), error_of(ours_.converged, method_.estimate()));
  }
  return way;
}

Way Comparison::cycles_way(const Contestant& cycles, std::uint32_t seed) const {
  const auto renders = render_with_cycles(cycles.cycles, doubling(4 * options_.samples), seed,
                                          directory_of(cycles) / ("round-" + std::to_string(seed)));
  Way way;
  for (const CyclesRender& render : renders)
    way.add(render.samples, render.cpu_s,
            error_of(cycles.converged, read_shadow_catcher(render.file, cycles.converged.frame)));
  return way;
}

std::vector<double> Comparison::print_times(const char* what, std::vector<Point> Way::*points,
                                            const Contestant& rival) const {
  std::vector<double> medians;
  for (const double error : options_.errors) {
    std::vector<double> ours, cycles, ratios;
    bool beyond = false;
    for (std::size_t i = 0; i < ours_.ways.size(); ++i) {
      const TimeToError a = time_to_error(ours_.ways[i].*points, error);
      const TimeToError b = time_to_error(rival.ways[i].*points, error);
      beyond = beyond || a.is_beyond || b.is_beyond;
      ours.push_back(a.cpu_s);
      cycles.push_back(b.cpu_s);
      ratios.push_back(b.cpu_s / a.cpu_s);
    }
    const auto [low, high] = std::ranges::minmax(ratios);
    medians.push_back(median(ratios));
    std::printf("| %s | %.3g %%%s | %.3g | %.3g | %.1f | %.1f to %.1f |\n", what, 100 * error,
                beyond ? " *" : "", median(ours), median(cycles), medians.back(), low, high);
  }
  return medians;
}

truth::EstimatedFrame estimate_of(const truth::TruthFrame& converged) {
  truth::EstimatedFrame estimate;
  estimate.mask = converged.mask;
  estimate.mixed = converged.mixed;
  estimate.real = converged.real;
  for (std::size_t i = 0; i < estimate.mask.size(); ++i)
    estimate.diff.push_back(estimate.mixed[i] - estimate.real[i]);
  return estimate;
}

// Both converged pictures against each other, as numbers and side by side.
void Comparison::print_agreement(const Contestant& cycles) const {
  const Reference &a = ours_.converged, &b = cycles.converged;
  const truth::Measures apart = error_of(a, estimate_of(b.frame));
  std::printf(
      "\nThe two converged pictures differ by %.4f in the difference, their noise is %.4f; on "
      "virtual objects by %.4f, their noise is %.4f.\n",
      apart.e_diff, std::hypot(a.noise.e_diff, b.noise.e_diff), apart.e_virtual,
      std::hypot(a.noise.e_virtual, b.noise.e_virtual));
  const auto composite = [&](const Reference& converged) {
    return truth::displayed(truth::ideal_composite(converged.frame), a.frame.width, a.frame.height,
                            a.frame.exposure, a.frame.response);
  };
  output::write_png(options_.out / view_.set / "previzd.png", composite(a));
  output::write_png(directory_of(cycles) / "converged.png", composite(b));
}

// Means of `factor`^2 pixels.
template <class T>
render::Sheet<T> reduced(const render::Sheet<T>& picture, int width, int height, int factor) {
  render::Sheet<T> out;
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

// The converged pictures against the truth, where its picture can be brought to their size.
void Comparison::print_bias() const {
  const truth::TruthSet set = truth::load_truth_set(set_);
  const auto& [width, height] = std::pair(options_.width, ours_.converged.frame.height);
  const PinholeIntrinsics& whole = set.observer.intrinsics;
  const int factor = whole.width / width;
  if (!set.has_pictures || distorted_ || factor * width != whole.width ||
      factor * height != whole.height) {
    std::printf("\nThe converged pictures are not compared with the truth: %s.\n",
                !set.has_pictures ? "the set has no truth pictures"
                                  : "its lens distorts, or its picture is no multiple of this one");
    return;
  }
  const truth::TruthFrame full = truth::load_truth_frame(set, view_.frame);
  Reference truth{ours_.converged.frame, {}};
  truth.frame.mixed = reduced(full.mixed, full.width, full.height, factor);
  truth.frame.real = truth.frame.plate = reduced(full.real, full.width, full.height, factor);
  truth.frame.mask = reduced(full.mask, full.width, full.height, factor);
  const auto print = [&](const Contestant& c) {
    const truth::Measures m = error_of(truth, estimate_of(c.converged.frame));
    std::printf("| %s | %.4f | %.4f | %+.4f | %.4f | %.4f | %+.4f |\n", c.name.c_str(), m.e_diff,
                c.converged.noise.e_diff, m.bias_diff, m.e_virtual, c.converged.noise.e_virtual,
                m.bias_virtual);
  };
  std::printf(
      "\nConverged pictures against the truth: error, its own noise, signed error\n\n"
      "| | difference | noise | bias | virtual objects | noise | bias |\n"
      "| --- | --- | --- | --- | --- | --- | --- |\n");
  print(ours_);
  for (const Contestant& cycles : cycles_) print(cycles);
}

std::vector<Ratio> Comparison::run() {
  for (int round = 1; round <= options_.rounds; ++round) {
    const auto seed = static_cast<std::uint32_t>(round);
    const std::string of =
        "round " + std::to_string(round) + " of " + std::to_string(options_.rounds) + ": ";
    ours_.ways.push_back(told(of + ours_.name, [&] { return our_way(seed); }));
    for (Contestant& cycles : cycles_)
      cycles.ways.push_back(told(of + cycles.name, [&] { return cycles_way(cycles, seed); }));
  }
  std::vector<Ratio> ratios;
  for (const Contestant& cycles : cycles_) {
    std::printf(
        "\n%s, frame %d, %dx%d, %s, %d threads. CPU seconds to an error; * beyond what was "
        "measured in some round\n\n"
        "| error of | error | previzd, s | Cycles, s | Cycles / previzd | spread |\n"
        "| --- | --- | --- | --- | --- | --- |\n",
        view_.set.c_str(), view_.frame, ours_.converged.frame.width, ours_.converged.frame.height,
        cycles.name.c_str(), cycles.cycles.threads);
    ratios.push_back({view_.set, cycles.name,
                      std::ranges::any_of(view_.scene.materials, has_mirror),
                      print_times("difference", &Way::diff, cycles)});
    print_times("virtual objects", &Way::virtual_part, cycles);
    print_agreement(cycles);
  }
  print_bias();
  std::fflush(stdout);
  return ratios;
}

void Comparison::write_points(std::ofstream& csv) const {
  const auto write = [&](const Contestant& c) {
    for (std::size_t round = 0; round < c.ways.size(); ++round) {
      const Way& way = c.ways[round];
      for (std::size_t i = 0; i < way.samples.size(); ++i)
        csv << view_.set << ',' << c.name << ',' << round + 1 << ',' << way.samples[i] << ','
            << way.diff[i].cpu_s << ',' << way.diff[i].error << ',' << way.virtual_part[i].error
            << '\n';
    }
  };
  write(ours_);
  for (const Contestant& cycles : cycles_) write(cycles);
  csv.flush();
}

void print_row(const Ratio& ratio, const char* caustics) {
  std::printf("| %s | %s | %s |", ratio.set.c_str(), ratio.program.c_str(), caustics);
  for (const double at : ratio.at) std::printf(" %.1f |", at);
  std::printf("\n");
}

// Each Blender's geometric mean over the sets without caustics.
void print_means(const Options& options, const std::vector<Ratio>& ratios, std::size_t blenders) {
  for (std::size_t b = 0; b < blenders; ++b) {
    Ratio mean{"geometric mean", ratios[b].program, false,
               std::vector<double>(options.errors.size(), 0)};
    int sets = 0;
    for (std::size_t i = b; i < ratios.size(); i += blenders) {
      if (ratios[i].has_caustics) continue;
      ++sets;
      for (std::size_t e = 0; e < mean.at.size(); ++e) mean.at[e] += std::log(ratios[i].at[e]);
    }
    if (sets == 0) continue;
    for (double& at : mean.at) at = std::exp(at / sets);
    print_row(mean, "without");
  }
}

void print_summary(const Options& options, const std::vector<Ratio>& ratios) {
  std::printf(
      "\nCPU time of Cycles over previzd's, to an error of the difference\n\n"
      "| set | Cycles of | caustics |");
  for (const double error : options.errors) std::printf(" %.3g %% |", 100 * error);
  std::printf("\n| --- | --- | --- |");
  for (std::size_t i = 0; i < options.errors.size(); ++i) std::printf(" --- |");
  std::printf("\n");
  for (const Ratio& ratio : ratios) print_row(ratio, ratio.has_caustics ? "with" : "without");
  print_means(options, ratios, options.blenders.size());
}

void compare_all(const Options& options) {
  const auto device = render::open_device();
  fs::create_directories(options.out);
  std::ofstream csv(options.out / "points.csv");
  csv << "set,program,round,samples,cpu_s,e_diff,e_virtual\n";
  std::vector<Ratio> ratios;
  for (const fs::path& set : options.sets) {
    Comparison comparison(device, options, set);
    for (Ratio& ratio : comparison.run()) ratios.push_back(std::move(ratio));
    comparison.write_points(csv);
  }
  if (!csv) throw Error((options.out / "points.csv").string() + ": cannot be written");
  print_summary(options, ratios);
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  previz::bench::Options options;
  CLI::App app("CPU time to an error, beside Blender Cycles' shadow catcher");
  app.add_option("SETDIR", options.sets, "Ground truth sets")->required();
  app.add_option("--blender", options.blenders, "Shell commands that start Blender [blender]");
  app.add_option("--script", options.script, "shadow_catcher.py")->required();
  app.add_option("--out", options.out, "Folder for what Blender renders")->required();
  app.add_option("--frame", options.frame, "Truth frame [the first]");
  app.add_option("--width", options.width, "Pixels");
  app.add_option("--rounds", options.rounds, "With random numbers of their own");
  app.add_option("--reference", options.reference_samples, "Samples of our converged picture");
  app.add_option("--cycles-reference", options.cycles_reference_samples, "Samples of Cycles'");
  app.add_option("--samples", options.samples, "Up to these; Cycles up to four times as many");
  app.add_option("--error", options.errors, "Shares, as 0.1");
  return previz::bench::run_program(app, argc, argv, [&] { previz::bench::compare_all(options); });
}
