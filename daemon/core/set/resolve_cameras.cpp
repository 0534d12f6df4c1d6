// The tables of the two cameras.
#include <map>

#include "daemon/core/set/resolving.hpp"
#include "drivers/calibration/read.hpp"

namespace previz::set {
namespace {

// Adds a problem if a part of a calibration is given without its intrinsics.
void needs_intrinsics(Resolving& work, const std::string& camera, const std::string& part) {
  const auto& table = work.given(camera + '.' + part);
  if (table.at && !work.given(camera + ".intrinsics").at)
    work.problems.add(*table.at, table.path,
                      '[' + camera + ".intrinsics]" +
                          " is missing; a calibration given here replaces all of the session's");
}

void device(Resolving& work, const std::string& table, const std::string& driver,
            std::string& device) {
  if (driver == no_driver)
    work.exclude(work.given(table), {"device"},
                 "driver \"none\" has no device; remove one of the two");
  if (driver == replay_driver && !device.empty()) device = work.located(device).string();
  const bool recorded = driver == replay_driver || driver == no_driver;
  if (!recorded && device.empty())
    work.problem(
        work.given(table), "device",
        "is missing for driver \"" + driver + "\"; allowed: a name that `previzd devices` prints");
  const Given& camera = work.given(table + ".camera");
  if (recorded && camera.at)
    work.problems.add(*camera.at, camera.path,
                      "cannot be used with driver \"" + driver + "\", which drives no camera");
  if (camera.has("width") != camera.has("height"))
    work.problem(camera, camera.has("width") ? "height" : "width",
                 "is missing; width and height go together");
  if (camera.has("exposure_s") && camera.has("bracket_s"))
    work.problem(camera, "exposure_s", "conflicts with bracket_s; remove one of the two");
}

// Reports what is wrong with a calibration, and completes it.
template <class CalibrationDraft>
void check(Resolving& work, const std::string& camera, CalibrationDraft& draft) {
  std::map<std::string, const Given*> tables;  // by key
  GivenKeys keys;
  for (const calibration::Key& key : calibration::keys(draft)) {
    const Given& table = *(tables[key.name] = &work.given(camera + '.' + key.table));
    if (table.has(key.name)) keys[key.name] = table.good(key.name);
  }
  for (const auto& [key, what] : calibration::check(draft, keys, calibration::Format::authored)) {
    const Given& table = *tables[key];
    if (table.at || table.path != "light_camera.pose") work.problem(table, key, what);
  }
}

void lens_fit(Resolving& work) {
  constexpr std::size_t values = 9, triangle = values * (values + 1) / 2;
  const auto& table = work.given("observer.lens_fit");
  const LensFit& fit = work.set.observer.lens_fit;
  if (table.good("values") && fit.values.size() != values)
    work.problem(table, "values",
                 "has " + std::to_string(fit.values.size()) + " numbers; allowed: 9");
  if (!table.good("covariance_root")) return;
  bool is_root = fit.covariance_root.size() == triangle;
  for (std::size_t row = 0; is_root && row < values; ++row)
    is_root = fit.covariance_root[row * (row + 3) / 2] > 0;
  if (!is_root)
    work.problem(
        table, "covariance_root",
        "is not the root of a covariance; allowed: the 45 numbers of a lower triangle, row by "
        "row, whose diagonal is above 0, as `previz calibrate observer` prints them");
}

void observer(Resolving& work) {
  device(work, "observer", work.set.observer.driver, work.set.observer.device);
  needs_intrinsics(work, "observer", "lens");
  needs_intrinsics(work, "observer", "response");
  needs_intrinsics(work, "observer", "lens_fit");
  lens_fit(work);
  check(work, "observer", work.draft.observer);
  if (work.given("observer.intrinsics").at)
    work.set.observer.calibration = work.draft.observer.calibration;
}

void light_camera(Resolving& work) {
  device(work, "light_camera", work.set.light_camera.driver, work.set.light_camera.device);
  needs_intrinsics(work, "light_camera", "response");
  needs_intrinsics(work, "light_camera", "pose");
  check(work, "light_camera", work.draft.light_camera);
  const auto& intrinsics = work.given("light_camera.intrinsics");
  if (!intrinsics.at) return;
  if (!work.given("light_camera.pose").at)
    work.problems.add(*intrinsics.at, "light_camera.pose",
                      "is missing; a calibrated light camera needs its pose: "
                      "[light_camera.pose] with position_m, rotation_deg or world_from_camera");
  work.set.light_camera.calibration = work.draft.light_camera.calibration;
}

}  // namespace

void resolve_cameras(Resolving& work) {
  observer(work);
  light_camera(work);
}

}  // namespace previz::set
