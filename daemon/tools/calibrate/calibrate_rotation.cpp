#include <fmt/ostream.h>

#include <cmath>

#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/scene/load.hpp"
#include "daemon/core/set/file_edit.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/calibrate/calibrate.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"
#include "daemon/tools/calibrate/sensor/rotation_fit.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr int frames = 3, width = 80;
// By the true environment of a set, shading stays off by 3.9 %
// (TruthBalance.ATurnedEnvironmentIsFoundByItsShadows); half as much again is worth a word.
constexpr double own_room = 0.04, often_another_room = 0.06;

}  // namespace

void calibrate_rotation(const LightOptions& options, std::ostream& out) {
  if (options.write && !options.set_file)
    throw Error("--write needs --set: it changes that set file");
  const pipeline::Take take = pipeline::open_take(options.footage, options.set_file);
  if (!take.set.lighting.environment)
    throw Error(
        options.footage.string() +
        ": its set has no lighting.environment that could be turned; a light camera's place "
        "is its [light_camera.pose], which --tags SET finds");
  const scene::Scene scene = scene::load_scene(take.set);
  const auto device = render::open_device(render::options_for({}, take.set.quality.hardware_rays));
  const ShadingAt shading = shading_of(take, scene, device, frames, width);
  int tried = 0;
  const RotationFit fit = fit_rotation([&](double rotation_rad, int samples) {
    constexpr int on_a_line = 8;
    out << (tried++ % on_a_line > 0 ? "" : tried > 1 ? "\ntrying" : "trying");
    out << fmt::format(" {:+.0f}", rotation_rad / degree) << std::flush;
    return shading(rotation_rad, samples);
  });
  out << " degrees\n";
  const double rotation = std::remainder(
      take.set.lighting.environment_rotation_rad + fit.rotation_rad, 2 * std::numbers::pi);
  fmt::print(
      out,
      "shading and shadows are off by {:.1f} % with the environment as it is, and by {:.1f} % "
      "turned by {:+.1f} +- {:.1f} degrees\n",
      100 * fit.off_unturned, 100 * fit.off, fit.rotation_rad / degree, fit.sigma_rad / degree);
  if (fit.off > often_another_room)
    fmt::print(
        out,
        "the environment of a set itself leaves about {:.0f} %: this one may be of another "
        "room, or the model lacks what casts shadows there; the direction is then off by more "
        "than is stated\n",
        100 * own_room);
  if (!fit.is_certain())
    throw Error(
        "the pictures do not tell how the environment is turned: no shadow and no shading of the "
        "model fits better there than elsewhere. Put something that casts a shadow, and its model, "
        "into the set, or turn lighting.environment_rotation_deg until shadows agree");
  const std::string table = set::environment_rotation_toml(rotation);
  if (options.write)
    write_back(*options.set_file,
               set::with_table(set::read_set_file(*options.set_file), "lighting", table), out);
  write_tables(table, options.table_file, out);
}

}  // namespace previz::calibrate
