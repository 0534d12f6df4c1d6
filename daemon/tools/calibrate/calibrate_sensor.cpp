#include <fmt/ostream.h>

#include "daemon/core/set/load.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/calibrate/calibrate.hpp"
#include "daemon/tools/calibrate/known_camera.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"
#include "daemon/tools/calibrate/sensor/dark_fit.hpp"
#include "daemon/tools/calibrate/sensor/vignetting_fit.hpp"

namespace previz::calibrate {
namespace {

// Under even light only noise is left; a residual above this means that the light was not even.
constexpr double most_uneven = 0.03;

void print_vignetting(const VignettingFit& fit, double max_angle_rad, std::ostream& out) {
  out << "transmission by angle off axis:";
  for (int angle = 0; angle * degree <= max_angle_rad; angle += 15)
    fmt::print(out, " {} deg {:.3f}", angle, relative_illumination(fit.vignetting, angle * degree));
  fmt::print(out, "\nunexplained: {:.2f} % (rms)\n", 100 * fit.rms);
}

std::vector<std::string> missing_light(const VignettingFit& fit, double max_angle_rad) {
  std::vector<std::string> missing;
  if (fit.widest_rad < 0.95 * max_angle_rad)
    missing.push_back(
        fmt::format("even light beyond {:.0f} degrees off axis (the lens is valid "
                    "to {:.0f})",
                    fit.widest_rad / degree, max_angle_rad / degree));
  if (fit.rms > most_uneven)
    missing.push_back(
        fmt::format("even light: {:.1f} % is unexplained, at most {:.0f} % "
                    "is noise",
                    100 * fit.rms, 100 * most_uneven));
  return missing;
}

}  // namespace

void calibrate_dark(const DarkOptions& options, std::ostream& out) {
  const auto source = open_source(options.footage, "light");
  LightCameraCalibration camera = light_sensor(options.set_file, options.footage);
  const DarkFit fit = fit_dark(*source, camera.response);
  for (const std::string& note : source->notes()) out << note << '\n';
  fmt::print(out,
             "{} pictures: dark level {:.5f}, {:.5f}, {:.5f} of white; noise {:.5f}, {:.5f}, "
             "{:.5f}; {} hot pixels\n",
             fit.pictures, fit.level.r, fit.level.g, fit.level.b, fit.noise.r, fit.noise.g,
             fit.noise.b, fit.hot_pixels);
  camera.dark_level = fit.level;
  write_tables(set::response_toml(camera), options.table_file, out);
}

void calibrate_vignetting(const VignettingOptions& options, std::ostream& out) {
  LightCameraCalibration camera =
      known_light_camera(set::load_set(options.set_file), options.footage);
  const auto source = open_source(options.footage, "light");
  std::vector<std::string> notes;
  std::vector<FlatPicture> pictures = read_flat_pictures(*source, camera, notes);
  for (const auto& some : {source->notes(), notes})
    for (const std::string& note : some) out << note << '\n';
  const double widest = camera.intrinsics.max_angle_rad;
  const VignettingFit fit = fit_vignetting(pictures, widest);
  for (const FlatPicture& picture : pictures)
    fmt::print(out, "{}: {} pixels, {:.2f} % unexplained\n", picture.name, picture.samples.size(),
               100 * picture.rms);
  print_vignetting(fit, widest, out);
  const std::string doubts = insist(missing_light(fit, widest), options.force, out);
  camera.vignetting = fit.vignetting;
  write_tables(doubts + set::intrinsics_toml(camera), options.table_file, out);
}

}  // namespace previz::calibrate
