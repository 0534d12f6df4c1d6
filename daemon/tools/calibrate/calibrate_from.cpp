#include <fmt/ostream.h>

#include <cmath>

#include "daemon/core/session/files.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/tools/calibrate/calibrate.hpp"
#include "daemon/tools/calibrate/lens/lens_file.hpp"
#include "daemon/tools/calibrate/lens/lens_file_check.hpp"
#include "daemon/tools/calibrate/lens/lens_refit.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"
#include "drivers/error.hpp"
#include "drivers/keys/value.hpp"

namespace previz::calibrate {
namespace {

constexpr double most_refit_px = 0.1;

// Reports how well a lens was fitted, and returns a comment for the table if it is forced.
template <typename Intrinsics>
std::string report_refit(const Refit<Intrinsics>& refit, const char* role, bool force,
                         std::ostream& out) {
  const std::string how = fmt::format(
      "its model is fitted by the {} camera's: at most {:.2g} px off over the whole picture (at "
      "pixel {:.0f}, {:.0f})",
      role, refit.worst_px, refit.worst_pixel.x, refit.worst_pixel.y);
  if (!std::isfinite(refit.worst_px))
    throw Error(
        fmt::format("no lens of the {} camera fits at pixel {:.0f}, {:.0f}; use the other "
                    "of --as observer and --as light",
                    role, refit.worst_pixel.x, refit.worst_pixel.y));
  if (refit.worst_px > most_refit_px && !force)
    throw Error(
        fmt::format("{}; allowed: {:g} px; use the other of --as observer and --as light, "
                    "or --force to accept it anyway",
                    how, most_refit_px));
  fmt::print(out, "{}\n", how);
  return refit.worst_px > most_refit_px
             ? as_comment(fmt::format("{}: accepted with --force although {}; allowed: {:g} px",
                                      not_to_be_relied_on, how, most_refit_px))
             : as_comment(how);
}

std::string observer_table(const AnyLens& lens, bool force, std::ostream& out) {
  ObserverCalibration camera;
  std::string comment;
  if (const auto* pinhole = std::get_if<PinholeIntrinsics>(&lens)) {
    camera.intrinsics = *pinhole;
  } else {
    const auto refit = refit_as_pinhole(std::get<FisheyeIntrinsics>(lens));
    comment = report_refit(refit, "film", force, out);
    camera.intrinsics = refit.lens;
  }
  return comment + set::intrinsics_toml(camera);
}

std::string light_table(const AnyLens& lens, bool force, std::ostream& out) {
  LightCameraCalibration camera;
  std::string comment;
  if (const auto* fisheye = std::get_if<FisheyeIntrinsics>(&lens)) {
    camera.intrinsics = *fisheye;
  } else {
    const auto refit = refit_as_fisheye(std::get<PinholeIntrinsics>(lens));
    comment = report_refit(refit, "light", force, out);
    camera.intrinsics = refit.lens;
  }
  return comment + set::intrinsics_toml(camera);
}

// Returns the role that was asked for, or else the one that has the lens's own model.
CameraRole role_of(const FromOptions& options, const AnyLens& lens, std::ostream& out) {
  const bool is_fisheye = std::holds_alternative<FisheyeIntrinsics>(lens);
  const CameraRole own = is_fisheye ? CameraRole::light : CameraRole::observer;
  if (!options.as)
    fmt::print(out, "as {}, because the model is a {} (--as {} for the other camera)\n",
               is_fisheye ? "light" : "observer", is_fisheye ? "fisheye" : "pinhole",
               is_fisheye ? "observer" : "light");
  return options.as.value_or(own);
}

}  // namespace

void calibrate_from(const FromOptions& options, std::ostream& out) {
  const std::string file = options.file.string();
  std::optional<PictureSize> size;
  if (!options.size.empty()) size = parse_picture_size(options.size);
  const LensFile read = read_lens_file(session::read_file(options.file, lens_file_kind), file);
  FileLens lens = chosen_lens(read, options.camera, file);
  complete_lens(lens, size);
  const auto [width, height] = picture_size(lens.lens);
  const std::string source =
      fmt::format("{} ({}{}): {}, {} x {} px", printable(options.file.filename().string()),
                  read.format, options.camera ? ", camera " + printable(*options.camera) : "",
                  printable(lens.model), width, height);
  out << source << '\n';
  for (const std::string& note : read.notes) out << note << '\n';
  for (const std::string& note : lens.notes) out << note << '\n';
  const CameraRole role = role_of(options, lens.lens, out);
  const std::string table = role == CameraRole::observer
                                ? observer_table(lens.lens, options.force, out)
                                : light_table(lens.lens, options.force, out);
  write_tables(as_comment("from " + source) + table, options.table_file, out);
}

}  // namespace previz::calibrate
