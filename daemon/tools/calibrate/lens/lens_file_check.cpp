#include "daemon/tools/calibrate/lens/lens_file_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>

#include "daemon/tools/calibrate/lens/report.hpp"
#include "drivers/calibration/fisheye.hpp"
#include "drivers/calibration/keys.hpp"
#include "drivers/calibration/pinhole.hpp"
#include "drivers/error.hpp"
#include "drivers/keys/value.hpp"

namespace previz::calibrate {
namespace {

constexpr double least_pinhole_focal = 0.1, least_fisheye_focal = 0.05;  // of the longer side
constexpr double least_circle = 0.25;   // radius, of the shorter side
constexpr double doubtful_shift = 0.2;  // of a side
// The printed angle has 12 digits, and must not be above the angle at which the polynomial folds.
constexpr double below_fold = 1 - 1e-9;

void set_size(FileLens& file, const std::optional<PictureSize>& size) {
  std::visit(
      [&](auto& lens) {
        const PictureSize own{lens.width, lens.height};
        if (own == PictureSize{} && !size)
          fail_at({file.focal_at.file, 0, file.size_keys},
                  "the picture's size is missing; give it with --size, as --size 1920x1080");
        if (own != PictureSize{} && size && own != *size)
          fail_at({file.focal_at.file, 0, file.size_keys},
                  fmt::format("{}x{} conflicts with --size {}x{}; remove --size", own.width,
                              own.height, size->width, size->height));
        if (own != PictureSize{}) return;
        lens.width = size->width;
        lens.height = size->height;
      },
      file.lens);
}

void check_focal(const FileLens& file) {
  std::visit(
      [&](const auto& lens) {
        constexpr bool is_fisheye =
            std::is_same_v<std::remove_cvref_t<decltype(lens)>, FisheyeIntrinsics>;
        const int longer = std::max(lens.width, lens.height);
        const double least = (is_fisheye ? least_fisheye_focal : least_pinhole_focal) * longer;
        for (const auto& [name, value] : {std::pair{"fx", lens.fx}, std::pair{"fy", lens.fy}})
          if (value < least)
            fail_at(file.focal_at,
                    fmt::format("{} {:g} is not a focal length in px for a picture {} px wide: it "
                                "may be in mm; multiply it by the picture's width in px and divide "
                                "it by the sensor's width in mm, or check the picture's size",
                                name, value, lens.width));
      },
      file.lens);
}

void check_principal_point(FileLens& file) {
  std::visit(
      [&](const auto& lens) {
        const std::tuple<const char*, double, int> axes[] = {{"cx", lens.cx, lens.width},
                                                             {"cy", lens.cy, lens.height}};
        for (const auto& [name, value, side] : axes) {
          if (!(value >= -0.5 * side && value <= 1.5 * side))
            fail_at(file.focal_at,
                    fmt::format("{} {:g} is far outside of a picture of {} px; check the picture's "
                                "size, or calibrate again",
                                name, value, side));
          if (std::abs(value - 0.5 * (side - 1)) > doubtful_shift * side)
            file.notes.push_back(
                fmt::format("warning: {} {:g} is far from the centre of {} px: is the picture of "
                            "this size, and is it not cropped?",
                            name, value, side));
        }
      },
      file.lens);
}

// A fisheye's circle may be smaller than its picture, but not by so much.
void check_circle(const FisheyeIntrinsics& lens, double fold, const FilePlace& place) {
  const glm::dvec2 at = fisheye_pixel(lens, {std::sin(fold), 0, std::cos(fold)});
  const double circle = at.x - lens.cx;
  if (fold < std::numbers::pi && !(circle > least_circle * std::min(lens.width, lens.height)))
    fail_at(place,
            fmt::format("the fisheye folds back {:.1f} px off its centre, at {:.1f} degrees; "
                        "check the order of the coefficients, or calibrate again",
                        circle, fold / degree));
}

void set_max_angle(FisheyeIntrinsics& lens, const FilePlace& place,
                   std::vector<std::string>& notes) {
  lens.max_angle_rad = std::numbers::pi;
  const Fisheye whole(lens);
  const double fold = whole.max_angle_rad();
  check_circle(lens, fold, place);
  double corner = 0;
  for (const double x : {-0.5, lens.width - 0.5})
    for (const double y : {-0.5, lens.height - 0.5}) {
      const auto direction = whole.unproject({x, y});
      const double angle =
          direction ? std::atan2(std::hypot(direction->x, direction->y), direction->z) : fold;
      corner = std::max(corner, angle);
    }
  lens.max_angle_rad = std::min(corner, fold) * (corner < fold ? 1 : below_fold);
  notes.push_back(
      corner < fold
          ? fmt::format("max_angle_deg {:.2f} is that of the picture's farthest corner; lower it "
                        "to what the calibration saw",
                        lens.max_angle_rad / degree)
          : fmt::format("max_angle_deg {:.2f}: the picture does not reach beyond, or folds there; "
                        "lower it to what the calibration saw",
                        lens.max_angle_rad / degree));
}

}  // namespace

PictureSize parse_picture_size(const std::string& text) {
  PictureSize size;
  const char* const end = text.data() + text.size();
  const auto width = std::from_chars(text.data(), end, size.width);
  if (width.ec == std::errc{} && width.ptr != end && *width.ptr == 'x') {
    const auto height = std::from_chars(width.ptr + 1, end, size.height);
    const auto is_side = [](int side) {
      return side >= 1 && side <= calibration::max_picture_side_px;
    };
    if (height.ec == std::errc{} && height.ptr == end && is_side(size.width) &&
        is_side(size.height))
      return size;
  }
  throw Error(fmt::format("--size: \"{}\" is not valid; allowed: WIDTHxHEIGHT in px, each 1 to {}",
                          printable(text), calibration::max_picture_side_px));
}

PictureSize picture_size(const AnyLens& lens) {
  return std::visit([](const auto& any) { return PictureSize{any.width, any.height}; }, lens);
}

void refuse_folds(const PinholeIntrinsics& lens, const FilePlace& place) {
  const auto check = [&](int x, int y) {
    if (!undistort(lens, {x, y}))
      fail_at(place, fmt::format("the lens folds inside its picture, at pixel {}, {}; calibrate "
                                 "again, with corners near the edge of the picture or with fewer "
                                 "coefficients",
                                 x, y));
  };
  for (int x = 0; x < lens.width; ++x)
    for (const int y : {0, lens.height - 1}) check(x, y);
  for (int y = 0; y < lens.height; ++y)
    for (const int x : {0, lens.width - 1}) check(x, y);
}

void complete_lens(FileLens& file, const std::optional<PictureSize>& size) {
  set_size(file, size);
  check_focal(file);
  check_principal_point(file);
  if (auto* fisheye = std::get_if<FisheyeIntrinsics>(&file.lens))
    set_max_angle(*fisheye, file.focal_at, file.notes);
  else
    refuse_folds(std::get<PinholeIntrinsics>(file.lens), file.focal_at);
}

}  // namespace previz::calibrate
