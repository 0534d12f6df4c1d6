#include "daemon/core/set/print.hpp"

#include <algorithm>
#include <string_view>

#include "daemon/core/set/table.hpp"

namespace previz::set {
namespace {

std::vector<Key> keys_of(Draft& draft, const std::string& path) {
  const auto all = sections(draft);
  return std::ranges::find(all, path, &Section::path)->open().keys;
}

// Prints one table, but not the keys in `without`, which would contradict the others.
std::string table_toml(Draft draft, const std::string& path,
                       const std::vector<std::string>& without = {}) {
  Draft untouched;
  const auto defaults = keys_of(untouched, path);
  const auto keys = keys_of(draft, path);
  std::string text = '[' + path + "]\n";
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const std::string value = keys[i].print ? keys[i].print() : "";
    const bool is_default =
        keys[i].need.kind == Need::Kind::defaulted && value == defaults[i].initial;
    const bool contradicts = std::ranges::find(without, keys[i].name) != without.end();
    if (!value.empty() && !is_default && !contradicts) text += keys[i].name + " = " + value + '\n';
  }
  return text;
}

// Returns the keys that belong to the other kinds of curve.
std::vector<std::string> keys_of_other_kinds(const ResponseCurve& curve) {
  std::vector<std::string> others;
  if (curve.kind != ResponseCurve::Kind::gamma) others.push_back("gamma");
  if (curve.kind != ResponseCurve::Kind::table) others.push_back("table");
  return others;
}

}  // namespace

std::string intrinsics_toml(const ObserverCalibration& calibration) {
  Draft draft;
  draft.observer.calibration = calibration;
  return table_toml(std::move(draft), "observer.intrinsics");
}

std::string intrinsics_toml(const LightCameraCalibration& calibration) {
  Draft draft;
  draft.light_camera.calibration = calibration;
  return table_toml(std::move(draft), "light_camera.intrinsics");
}

std::string lens_fit_toml(const LensFit& fit) {
  Draft draft;
  draft.set.observer.lens_fit = fit;
  return table_toml(std::move(draft), "observer.lens_fit");
}

std::string lens_toml(const ThinLens& lens) {
  Draft draft;
  draft.observer.lens = lens;
  return table_toml(std::move(draft), "observer.lens");
}

std::string light_pose_toml(const glm::dmat4& world_from_camera) {
  Draft draft;
  draft.light_camera.pose.matrix = world_from_camera;
  return table_toml(std::move(draft), "light_camera.pose");
}

std::string response_toml(const ObserverCalibration& calibration) {
  Draft draft;
  draft.observer.calibration = calibration;
  return table_toml(std::move(draft), "observer.response",
                    keys_of_other_kinds(calibration.response));
}

std::string response_toml(const LightCameraCalibration& calibration) {
  Draft draft;
  draft.light_camera.calibration = calibration;
  return table_toml(std::move(draft), "light_camera.response",
                    keys_of_other_kinds(calibration.response));
}

std::string balance_toml(const glm::dvec3& balance) {
  Draft draft;
  draft.set.lighting.balance = balance;
  return table_toml(std::move(draft), "lighting");
}

std::string environment_rotation_toml(double rotation_rad) {
  Draft draft;
  draft.set.lighting.environment_rotation_rad = rotation_rad;
  return table_toml(std::move(draft), "lighting");
}

std::string overlay_toml(const Set& own, const Set& wanted) {
  Draft before, after;
  before.set = own;
  after.set = wanted;
  std::string text;
  for (const char* path : {"quality", "estimator", "lighting"}) {
    const auto old_keys = keys_of(before, path), keys = keys_of(after, path);
    std::string lines;
    for (std::size_t i = 0; i < keys.size(); ++i)
      if (keys[i].print && keys[i].print() != old_keys[i].print())
        lines += keys[i].name + " = " + keys[i].print() + '\n';
    if (!lines.empty()) text += std::string("[") + path + "]\n" + lines + '\n';
    if (std::string_view(path) != "quality") continue;
    for (const PreviewStep& step : wanted.quality.steps) {
      Draft draft;
      const auto step_keys = keys_of(draft, "quality.preview");
      draft.preview_steps.back().step = step;
      text += "[[quality.preview]]\n";
      for (const Key& key : step_keys)
        if (const std::string value = key.print(); !value.empty())
          text += key.name + " = " + value + '\n';
      text += '\n';
    }
  }
  return text;
}

std::string surface_toml(const Surface& surface) {
  Draft draft;
  const auto keys = keys_of(draft, "surface");
  draft.surfaces.back().surface = surface;
  std::string text = "[[surface]]\n";
  for (const Key& key : keys) text += key.name + " = " + key.print() + '\n';
  return text;
}

}  // namespace previz::set
