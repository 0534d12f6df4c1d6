#include <fmt/ostream.h>

#include <algorithm>
#include <cmath>

#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/core/set/file_edit.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/calibrate/calibrate.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"
#include "daemon/tools/calibrate/sensor/balance_fit.hpp"
#include "daemon/tools/calibrate/sensor/paper.hpp"
#include "daemon/tools/calibrate/sensor/surface_pixels.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

// A balance that is less certain than this is no measurement: half a stop either way.
constexpr double certain_stops = 0.5;

// Correct metadata are accurate to a third of a stop, as shutters and aperture rings are.
constexpr double stated_well_stops = 1.0 / 3;

std::string percent(const glm::dvec3& v) {
  return fmt::format("{:.1f} {:.1f} {:.1f} %", 100 * v.r, 100 * v.g, 100 * v.b);
}

// Returns what makes the balance no measurement, and what to do about it; empty: nothing.
std::string doubt(const Balance& balance) {
  const double sigma = exposure_error_sigma_stops(balance);
  if (sigma < certain_stops) return {};
  return fmt::format(
      "THE BALANCE IS UNCERTAIN by {:.1f} stops, because the surfaces disagree: list "
      "those of known colour with --reference, or put a grey card into the set and the model",
      sigma);
}

// An environment from elsewhere has a unit of its own; two cameras should agree.
void print_exposure(const Balance& balance, bool has_light_camera, std::ostream& out) {
  const double stops = exposure_error_stops(balance), sigma = exposure_error_sigma_stops(balance);
  const char* const off = stops > 0 ? "dark" : "bright";
  if (std::abs(stops) < stated_well_stops || std::abs(stops) < 3 * sigma)
    fmt::print(out, "{} to {:+.2f} +- {:.2f} stops\n",
               has_light_camera ? "the cameras' exposures agree"
                                : "the environment and the camera's exposure agree",
               stops, sigma);
  else if (has_light_camera)
    fmt::print(out,
               "THE CAMERAS' EXPOSURES DISAGREE by {:.2f} +- {:.2f} stops: the light of the light "
               "camera comes out too {}. Check shutter, gain and responsivity of both; the balance "
               "below makes up for it.\n",
               std::abs(stops), sigma, off);
  else
    fmt::print(out,
               "the environment is {:.2f} +- {:.2f} stops too {} for the camera's exposure; the "
               "balance below makes up for it\n",
               std::abs(stops), sigma, off);
}

// Returns the suggestion for one surface, as a table with its uncertainty, or a note if there is
// none.
std::string suggestion(const SurfaceRatio& surface, const KnownSurface& known,
                       const Balance& balance) {
  const AlbedoEstimate estimate = albedo_of(surface, known, balance);
  const std::string words = fmt::format(
      "# {}: albedo {:.3f} {:.3f} {:.3f} +- {:.3f} {:.3f} {:.3f}, the model has {:.3f} "
      "{:.3f} {:.3f}; {} pixels\n",
      known.material, estimate.albedo.r, estimate.albedo.g, estimate.albedo.b, estimate.sigma.r,
      estimate.sigma.g, estimate.sigma.b, known.albedo.r, known.albedo.g, known.albedo.b,
      surface.pixels);
  for (int c = 0; c < 3; ++c)
    if (estimate.albedo[c] > 1)
      return words + "# (an albedo above 1 is impossible: not suggested)\n";
  return words + set::surface_toml({known.material, estimate.albedo});
}

void print_balance(const SurfacePixels& seen, const Balance& balance, std::ostream& out) {
  fmt::print(out, "{}, {} of diffuse real surfaces\n",
             set::plural(seen.world_from_cameras.size(), "frame"),
             set::plural(seen.pixels.size(), "pixel"));
  for (const SurfaceRatio& surface : balance.surfaces)
    fmt::print(out, "  {}: camera / model {:.3f} {:.3f} {:.3f} (+- {}), {} in {}{}\n",
               seen.surfaces[surface.surface].material, surface.ratio.r, surface.ratio.g,
               surface.ratio.b, percent(surface.sigma),
               set::plural(std::uint64_t(surface.pixels), "pixel"),
               set::plural(std::uint64_t(surface.tiles), "tile"),
               surface.reference ? "" : ", not a reference");
  fmt::print(out, "balance {:.4f} {:.4f} {:.4f} (+- {})\n", balance.scale.r, balance.scale.g,
             balance.scale.b, percent(balance.sigma));
}

// Says why the tags' paper is not what decides, where nothing else was asked for. Throws
// previz::Error if it was.
void report_paper(const std::string& why_not, const std::vector<std::string>& references,
                  std::ostream& out) {
  if (why_not.empty()) return;
  if (std::ranges::find(references, paper_name) != references.end())
    throw Error("the printed tags' white paper cannot be used: " + why_not);
  if (references.empty())
    fmt::print(
        out,
        "the printed tags' white paper is not used: {}. The colours that the model has decide "
        "instead; the balance is no better than they are\n",
        why_not);
}

SurfacePixels probed(const pipeline::Take& take, const BalanceOptions& options, std::ostream& out) {
  const scene::Scene scene = scene::load_scene(take.set);
  const auto device =
      render::open_device(render::options_for(options.device, take.set.quality.hardware_rays));
  SurfaceProbe surfaces(take, scene, device, {});
  Paper paper(take.set, take.observer, scene, device, options.samples);
  each_probed_shot(take, options.frames, [&](const ProbedShot& shot) {
    surfaces.add(shot);
    paper.look_at(shot);
  });
  report_paper(paper.why_not(), options.references, out);
  SurfacePixels seen = surfaces.compare(scene, options.samples);
  append(paper.seen(), seen);
  return seen;
}

}  // namespace

void calibrate_balance(const BalanceOptions& options, std::ostream& out) {
  if (options.write && !options.set_file)
    throw Error("--write needs --set: it changes that set file");
  const pipeline::Take take = pipeline::open_take(options.session, options.set_file);
  const SurfacePixels seen = probed(take, options, out);
  const Balance balance = fit_balance(seen, options.references);
  print_balance(seen, balance, out);
  print_exposure(balance, !take.set.lighting.environment, out);
  const std::string uncertain = doubt(balance);
  if (!uncertain.empty()) fmt::print(out, "{}\n", uncertain);
  const std::string table = set::balance_toml(take.set.lighting.balance * balance.scale);
  if (options.write)
    write_back(*options.set_file,
               set::with_table(set::read_set_file(*options.set_file), "lighting", table), out);
  std::string tables = uncertain.empty() ? "" : as_comment(uncertain);
  tables += table;
  if (options.write)
    tables +=
        "\n# Not written: the colours that the surfaces have in these pictures. `previz model`\n"
        "# measures them more closely.\n";
  for (const SurfaceRatio& surface : balance.surfaces)
    if (seen.surfaces[surface.surface].material != paper_name)
      tables += fmt::format("\n{}", suggestion(surface, seen.surfaces[surface.surface], balance));
  write_tables(tables, options.table_file, out);
}

}  // namespace previz::calibrate
