#include "daemon/core/set/check.hpp"

#include <numbers>
#include <ostream>

#include "daemon/core/set/implausible.hpp"
#include "daemon/core/set/names.hpp"
#include "drivers/error.hpp"

namespace previz::set {

void Findings::attempt(const std::function<void()>& work) {
  try {
    work();
  } catch (const Error& error) {
    problems.emplace_back(error.what());
  }
}

std::string grouped(std::uint64_t number) {
  auto digits = std::to_string(number);
  for (auto at = static_cast<std::ptrdiff_t>(digits.size()) - 3; at > 0; at -= 3)
    digits.insert(static_cast<std::size_t>(at), 1, ' ');
  return digits;
}

std::string plural(std::uint64_t number, const std::string& noun) {
  return grouped(number) + ' ' + noun + (number == 1 ? "" : "s");
}

std::optional<double> stated_exposure(const Set& set) {
  const Observer& observer = set.observer;
  if (observer.exposure) return observer.exposure;
  const CameraSettings& settings = observer.camera.settings;
  if (!settings.exposure_s) return {};
  return *settings.exposure_s * settings.gain.value_or(1) *
         (observer.calibration ? observer.calibration->responsivity : 1);
}

void check_cameras(const CheckedSet& checked, Findings& findings) {
  if (checked.is_take) return;
  for (const std::string& line : other_sizes(checked.set))
    findings.problems.push_back(checked.set.file.string() + ": " + line);
}

void remark_on_cameras(const CheckedSet& checked, Findings& findings) {
  for (const std::string& line : implausible(checked.set)) findings.remarks.push_back(line);
  const auto& set = checked.set;
  if (!set.observer.calibration)
    findings.remarks.push_back(
        "no film camera calibration here: it must come with the session to be rendered");
  const bool has_light_camera =
      set.light_camera.driver != no_driver && set.light_camera.calibration;
  if (set.lighting.from == LightFrom::camera && !set.lighting.environment && !has_light_camera)
    findings.remarks.push_back(
        "no environment and no calibrated light camera here: the session must supply the light");
}

void describe_cameras(const Set& set, std::ostream& out) {
  const auto device = [](const std::string& driver, const std::string& name) {
    return words(driver, name.empty() ? "" : " of ", name);
  };
  out << "\ncameras\n  observer      " << device(set.observer.driver, set.observer.device);
  if (const auto& c = set.observer.calibration) {
    out << words(", ", c->intrinsics.width, "x", c->intrinsics.height, ", ");
    if (c->lens)
      out << words(c->lens->focal_length_m * 1e3, " mm lens at f/", c->lens->f_number,
                   ", focus at ", c->lens->focus_distance_m, " m");
    else
      out << "everything in focus";
  }
  out << "\n  light camera  " << device(set.light_camera.driver, set.light_camera.device);
  if (const auto& c = set.light_camera.calibration; c && set.light_camera.driver != no_driver)
    out << words(", ", c->intrinsics.width, "x", c->intrinsics.height, ", calibrated to ",
                 c->intrinsics.max_angle_rad * 180 / std::numbers::pi, " degrees off axis");
  out << '\n';
}

void describe_estimator(const Set& set, std::ostream& out) {
  const auto& e = set.estimation;
  out << "\nestimator\n  " << name_of(e.estimator) << ", " << name_of(e.composite) << ", "
      << plural(static_cast<std::uint64_t>(set.quality.samples), "sample")
      << " per pixel and frame, at most " << e.max_depth << " bounces, caustics "
      << name_of(e.caustics) << ", seed " << e.seed << '\n';
}

}  // namespace previz::set
