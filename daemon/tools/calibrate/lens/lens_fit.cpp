#include "daemon/tools/calibrate/lens/lens_fit.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

constexpr double contradicting = 0.05;

struct Found {
  double value;
  const char* source;
};

Found one_of(const std::optional<double>& stated, const std::optional<double>& from_photo,
             const std::string& what) {
  if (stated) return {*stated, "stated"};
  if (from_photo) return {*from_photo, "the photograph's EXIF"};
  throw Error("the lens's " + what + " is unknown; give it, or a photograph with EXIF data");
}

// Computes the focal length from the calibrated image distance; returns nothing without the
// sensor's width.
std::optional<double> computed_focal_length_m(const LensFacts& facts, double focus_m) {
  if (!facts.sensor_width_m || !facts.intrinsics) return std::nullopt;
  const double image_m = facts.intrinsics->fx * *facts.sensor_width_m / facts.intrinsics->width;
  return image_m * focus_m / (image_m + focus_m);
}

}  // namespace

LensFound find_lens(const LensFacts& facts) {
  const PhotoData photo = facts.photo.value_or(PhotoData{});
  LensFound found;
  const Found focus = one_of(facts.focus_distance_m, photo.focus_distance_m, "focus distance");
  const Found stop = one_of(facts.f_number, photo.f_number, "f-number");
  const auto computed = computed_focal_length_m(facts, focus.value);
  const auto known = facts.focal_length_m ? facts.focal_length_m : photo.focal_length_m;
  const Found focal = known || !computed
                          ? one_of(facts.focal_length_m, photo.focal_length_m, "focal length")
                          : Found{*computed, "the calibration and the sensor's width"};
  found.lens = {focal.value, stop.value, focus.value};
  if (!(found.lens.focus_distance_m > found.lens.focal_length_m))
    throw Error(fmt::format("focus distance {} m must exceed the focal length {} mm", focus.value,
                            1000 * focal.value));
  found.notes = {fmt::format("focal length {:.2f} mm: {}", 1000 * focal.value, focal.source),
                 fmt::format("f-number {:g}: {}", stop.value, stop.source),
                 fmt::format("focus distance {:g} m: {}", focus.value, focus.source)};
  if (computed && std::abs(*computed / focal.value - 1) > contradicting)
    found.notes.push_back(fmt::format(
        "THE CALIBRATION SAYS {:.2f} mm with this sensor: is the picture cropped or scaled, or was "
        "the zoom moved?",
        1000 * *computed));
  return found;
}

SharpRange sharp_range(const ThinLens& lens, double fx, double circle_px) {
  const double aperture = lens.focal_length_m / lens.f_number;
  const double half = circle_px / (fx * aperture), at = 1 / lens.focus_distance_m;
  return {1 / (at + half), at > half ? 1 / (at - half) : std::numeric_limits<double>::infinity()};
}

}  // namespace previz::calibrate
