// lighting_report SETDIR...: captured light against the true environment of ground truth sets, and
// both as pictures to look at.
#include <cmath>
#include <cstdio>
#include <map>

#include "daemon/output/png.hpp"
#include "drivers/error.hpp"
#include "tests/bench/program.hpp"
#include "tests/support/lighting.hpp"
#include "tests/truth/lighting_measure.hpp"

namespace {

using namespace previz;

const std::map<std::string, set::UnseenRule> unseen_rules{{"constant", set::UnseenRule::constant},
                                                          {"horizon", set::UnseenRule::horizon},
                                                          {"mirror", set::UnseenRule::mirror}};

void print(const char* what, const truth::IrradianceError& error) {
  std::printf("  irradiance, %-34s mean %.2f %%, worst %.2f %%\n", what, 100 * error.mean,
              100 * error.worst);
}

void report(const truth::TruthSet& set, const truth::LightingMeasure& measure,
            std::size_t exposures) {
  const auto& seen = measure.captured.report;
  std::printf("%s: %zu exposures to %dx%d in %.0f ms\n", set.name.c_str(), exposures,
              measure.captured.environment.size, measure.captured.environment.size,
              measure.milliseconds);
  std::printf("  sr: seen %.3f, filled %.3f, clipped %.5f, black %.5f, compared %.3f\n",
              seen.seen_sr, seen.filled_sr, seen.overexposed_sr, seen.underexposed_sr,
              measure.compared_sr);
  print("where the camera sees it", measure.irradiance);
  if (measure.resampling) print("from the noise-free fisheye", *measure.resampling);
  print("whole sphere", measure.sphere);
  for (const truth::LampError& lamp : measure.lamps)
    std::printf("  lamp %s: direction off by %.3f degrees, flux ratio %.4f %.4f %.4f\n",
                lamp.lamp.name.c_str(), lamp.direction_rad * 57.29577951, lamp.flux_ratio.r,
                lamp.flux_ratio.g, lamp.flux_ratio.b);
  const lighting::Extraction& extraction = measure.extraction;
  std::printf("  %zu sources, %d bright regions left in the picture\n", extraction.sources.size(),
              extraction.left);
  for (const lighting::Source& source : extraction.sources)
    std::printf("    azimuth %.2f, elevation %.2f, radius %.2f degrees, flux %.4g %.4g %.4g\n",
                std::atan2(source.direction.y, source.direction.x) * 57.29577951,
                std::asin(source.direction.z) * 57.29577951,
                lighting::angular_radius(source) * 57.29577951, source.flux.r, source.flux.g,
                source.flux.b);
  for (const truth::SourceError& error : measure.sources)
    std::printf(
        "  lamp %s by its source: direction off by %.3f degrees, radius ratio %.3f, flux "
        "ratio %.4f %.4f %.4f\n",
        error.lamp.name.c_str(), error.direction_rad * 57.29577951, error.radius_ratio,
        error.flux_ratio.r, error.flux_ratio.g, error.flux_ratio.b);
  for (const std::string& note : seen.notes) std::printf("  note: %s\n", note.c_str());
}

void write_pictures(const std::filesystem::path& directory, const std::string& name,
                    const lighting::EnvironmentMap& map) {
  const lighting::LinearPicture picture = lighting::to_latitude_longitude(map, 1024);
  lighting::write_exr_picture(directory / (name + ".exr"), picture);
  output::write_png(directory / (name + ".png"), lighting::tone_map(picture));
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Captured light against true light on ground truth sets (set.json, light/)");
  std::vector<std::string> sets;
  std::string out;
  set::Lighting settings;
  bool single = false;
  app.add_option("SETDIR", sets)->required()->check(CLI::ExistingDirectory);
  app.add_option("--unseen", settings.unseen, "rule for what the fisheye cannot see")
      ->transform(CLI::CheckedTransformer(unseen_rules));
  app.add_option("--resolution", settings.resolution, "texels a side; 0: from the camera");
  app.add_flag("--single", single, "the last frame only instead of all exposures");
  app.add_option("--out", out, "directory for latitude-longitude pictures of both maps");
  return previz::bench::run_program(app, argc, argv, [&] {
    if (!out.empty()) std::filesystem::create_directories(out);
    for (const std::string& directory : sets) {
      const truth::TruthSet set = truth::load_truth_set(directory);
      std::vector<FramePtr> frames = truth::load_light_frames(set);
      if (single) frames.erase(frames.begin(), frames.end() - 1);
      const truth::LightingMeasure measure = truth::measure_lighting(set, frames, settings);
      report(set, measure, frames.size());
      if (out.empty()) continue;
      write_pictures(out, set.name + "_captured", measure.captured.environment);
      write_pictures(out, set.name + "_true", measure.truth);
    }
  });
}
