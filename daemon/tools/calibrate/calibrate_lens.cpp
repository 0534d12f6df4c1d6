#include <fmt/ostream.h>

#include "daemon/core/session/session.hpp"
#include "daemon/core/set/load.hpp"
#include "daemon/core/set/print.hpp"
#include "daemon/core/set/set.hpp"
#include "daemon/tools/calibrate/calibrate.hpp"
#include "daemon/tools/calibrate/lens/lens_fit.hpp"
#include "daemon/tools/calibrate/lens/report.hpp"

namespace previz::calibrate {
namespace {

constexpr double metres_per_mm = 1e-3;

std::optional<double> metres(const std::optional<double>& mm) {
  return mm ? std::optional(*mm * metres_per_mm) : std::nullopt;
}

}  // namespace

void calibrate_lens(const ThinLensOptions& options, std::ostream& out) {
  LensFacts facts;
  facts.focal_length_m = metres(options.focal_length_mm);
  facts.f_number = options.f_number;
  facts.focus_distance_m = options.focus_distance_m;
  facts.sensor_width_m = metres(options.sensor_width_mm);
  if (options.photo) facts.photo = read_exif(*options.photo);
  if (options.set_file)
    if (const auto calibration = set::load_set(*options.set_file).observer.calibration)
      facts.intrinsics = calibration->intrinsics;
  const LensFound found = find_lens(facts);
  for (const std::string& note : found.notes) out << note << '\n';
  if (facts.intrinsics) {
    const SharpRange sharp = sharp_range(found.lens, facts.intrinsics->fx, 1);
    fmt::print(out, "sharp to within 1 px from {:.3f} m to {:.3f} m\n", sharp.near_m, sharp.far_m);
  }
  write_tables(set::lens_toml(found.lens), options.table_file, out);
}

}  // namespace previz::calibrate
