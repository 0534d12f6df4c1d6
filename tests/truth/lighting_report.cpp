// lighting_report SETDIR...: captured light against the true environment of ground truth sets.
#include <cstdio>

#include "tests/bench/program.hpp"
#include "tests/truth/lighting_measure.hpp"

namespace {

using namespace previz;

constexpr double degrees = 57.29577951;  // of a radian

void print(const char* what, const truth::IrradianceError& error) {
  std::printf("  irradiance, %-28s mean %.2f %%, worst %.2f %%\n", what, 100 * error.mean,
              100 * error.worst);
}

void report(const truth::TruthSet& set) {
  const auto measure = truth::measure_lighting(set, truth::load_light_frames(set), {});
  const auto& seen = measure.captured.report;
  std::printf("%s: %zu exposures to %dx%d; seen %.3f sr, filled %.3f, compared %.3f\n",
              set.name.c_str(), set.light_frames.size(), measure.captured.environment.size,
              measure.captured.environment.size, seen.seen_sr, seen.filled_sr, measure.compared_sr);
  print("where the camera sees it", measure.irradiance);
  if (measure.resampling) print("from the noise-free fisheye", *measure.resampling);
  print("whole sphere", measure.sphere);
  for (const truth::LampError& lamp : measure.lamps)
    std::printf("  lamp %s: direction off by %.3f degrees, flux ratio %.4f %.4f %.4f\n",
                lamp.lamp.name.c_str(), degrees * lamp.direction_rad, lamp.flux_ratio.r,
                lamp.flux_ratio.g, lamp.flux_ratio.b);
  for (const std::string& note : seen.notes) std::printf("  note: %s\n", note.c_str());
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Captured light against true light on ground truth sets (set.json, light/)");
  std::vector<std::string> sets;
  app.add_option("SETDIR", sets)->required()->check(CLI::ExistingDirectory);
  return previz::bench::run_program(app, argc, argv, [&] {
    for (const std::string& directory : sets) report(truth::load_truth_set(directory));
  });
}
