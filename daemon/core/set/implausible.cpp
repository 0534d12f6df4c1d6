#include "daemon/core/set/implausible.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "daemon/core/set/names.hpp"

namespace previz::set {
namespace {

using Lines = std::vector<std::string>;

constexpr double least_tag_m = 0.005, largest_tag_m = 0.5, farthest_m = 100;
constexpr double least_view_deg = 1, widest_view_deg = 150;
constexpr double most_stretch = 1.2;         // of pixels; an anamorphic lens is 1.33 to 2
constexpr double middle_share = 0.5;         // of the picture, in which the principal point lies
constexpr double shutter_tolerance = 1.001;  // a shutter that is open all the time

void look_at_tag(const Tag& tag, Lines& lines) {
  const double size = tag.size_m;
  if (size > largest_tag_m)
    lines.push_back(
        fmt::format("tag {}: its side is {:g} m; sizes are in metres, so {:g} mm is {:g}", tag.id,
                    size, size >= 5 ? size : 100 * size, size >= 5 ? size / 1000 : size / 10));
  else if (size < least_tag_m)
    lines.push_back(
        fmt::format("tag {}: its side is {:g} mm: sizes are in metres", tag.id, 1000 * size));
  const glm::dvec3 place(tag.world_from_tag[3]);
  if (glm::length(place) > farthest_m)
    lines.push_back(fmt::format("tag {}: it is {:.0f} m from the origin: places are in metres",
                                tag.id, glm::length(place)));
}

void look_at_intrinsics(const PinholeIntrinsics& i, Lines& lines) {
  const double view = 2 * std::atan(0.5 * i.width / i.fx) * 180 / std::numbers::pi;
  if (view < least_view_deg || view > widest_view_deg)
    lines.push_back(fmt::format(
        "[observer.intrinsics] fx = {:g}: a picture {} px wide would show {:.3g} degrees; fx and "
        "fy are in pixels: the focal length in mm, over the sensor's width in mm, times {}",
        i.fx, i.width, view, i.width));
  const double stretch = std::max(i.fx / i.fy, i.fy / i.fx);
  if (stretch > most_stretch)
    lines.push_back(fmt::format(
        "[observer.intrinsics] fx = {:g} and fy = {:g} differ by {:.0f} %, as only an anamorphic "
        "lens's do",
        i.fx, i.fy, 100 * (stretch - 1)));
  if (std::abs((i.cx + 0.5) / i.width - 0.5) > 0.5 * middle_share ||
      std::abs((i.cy + 0.5) / i.height - 0.5) > 0.5 * middle_share)
    lines.push_back(fmt::format(
        "[observer.intrinsics] cx = {:g}, cy = {:g}: the optical axis would lie at the edge of the "
        "picture of {}x{}; are these numbers for another picture size?",
        i.cx, i.cy, i.width, i.height));
}

void look_at_lens(const ThinLens& lens, Lines& lines) {
  const double focal_mm = 1000 * lens.focal_length_m;
  if (focal_mm < 1 || focal_mm > 3000)
    lines.push_back(
        fmt::format("[observer.lens] focal_length_mm = {:g}: it is in millimetres", focal_mm));
  if (lens.f_number < 0.5 || lens.f_number > 64)
    lines.push_back(
        fmt::format("[observer.lens] f_number = {:g}: no lens has this aperture", lens.f_number));
  if (lens.focus_distance_m < 0.02 || lens.focus_distance_m > 1000)
    lines.push_back(fmt::format(
        "[observer.lens] focus_distance_m = {:g}: it is in metres; remove the table, and "
        "everything is sharp",
        lens.focus_distance_m));
}

void look_at_shutter(const std::string& camera, const CameraWish& wish, Lines& lines) {
  if (!wish.settings.rate_hz) return;
  std::vector<double> times = wish.bracket_s;
  if (wish.settings.exposure_s) times.push_back(*wish.settings.exposure_s);
  if (times.empty()) return;
  const double longest = *std::ranges::max_element(times), frame_s = 1 / *wish.settings.rate_hz;
  if (longest > shutter_tolerance * frame_s)
    lines.push_back(fmt::format(
        "[{}.camera] exposes for {:g} s, longer than a frame lasts at {:g} per second ({:.3g} s): "
        "the camera will be slower, or expose less; times are in seconds",
        camera, longest, *wish.settings.rate_hz, frame_s));
}

void look_at_size(const std::string& camera, const CameraWish& wish, const std::string& driver,
                  int width, int height, Lines& lines) {
  const CameraSettings& settings = wish.settings;
  const bool differs =
      settings.width && settings.height && (*settings.width != width || *settings.height != height);
  if (driver != replay_driver && differs)
    lines.push_back(fmt::format(
        "[{0}.camera] is {1}x{2} and [{0}.intrinsics] is for {3}x{4}: calibrate the camera at the "
        "size that it is used with (previz calibrate {5}); only if it scales the whole picture, "
        "multiply fx and cx + 0.5 by {6:.6g}, fy and cy + 0.5 by {7:.6g}",
        camera, *settings.width, *settings.height, width, height,
        camera == "observer" ? "observer" : "light", double(*settings.width) / width,
        double(*settings.height) / height));
}

}  // namespace

std::vector<std::string> implausible(const Set& set) {
  Lines lines;
  for (const Tag& tag : set.tracking.tags) look_at_tag(tag, lines);
  for (const Carrier& carrier : set.tracking.carriers)
    for (const Tag& tag : carrier.tags) look_at_tag(tag, lines);
  if (const auto& camera = set.observer.calibration) {
    look_at_intrinsics(camera->intrinsics, lines);
    if (camera->lens) look_at_lens(*camera->lens, lines);
  }
  look_at_shutter("observer", set.observer.camera, lines);
  look_at_shutter("light_camera", set.light_camera.camera, lines);
  if (const auto& light = set.light_camera.calibration)
    if (const glm::dvec3 place(light->world_from_camera[3]); glm::length(place) > farthest_m)
      lines.push_back(
          fmt::format("[light_camera.pose] is {:.0f} m from the origin: places are in metres",
                      glm::length(place)));
  return lines;
}

std::vector<std::string> other_sizes(const Set& set) {
  Lines lines;
  if (const auto& camera = set.observer.calibration)
    look_at_size("observer", set.observer.camera, set.observer.driver, camera->intrinsics.width,
                 camera->intrinsics.height, lines);
  if (const auto& light = set.light_camera.calibration)
    look_at_size("light_camera", set.light_camera.camera, set.light_camera.driver,
                 light->intrinsics.width, light->intrinsics.height, lines);
  return lines;
}

}  // namespace previz::set
