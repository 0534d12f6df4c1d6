#include "drivers/calibration/read.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

#include "drivers/calibration/fisheye.hpp"

namespace previz::calibration {
namespace {

using Faults = std::vector<KeyFault>;

const Key& key_named(const std::vector<Key>& all, std::string_view name) {
  return *std::ranges::find(all, name, [](const Key& key) { return std::string_view(key.name); });
}

bool is_good(const GivenKeys& given, const std::string& key) {
  const auto found = given.find(key);
  return found != given.end() && found->second;
}

bool is_bad(const GivenKeys& given, const std::string& key) {
  return given.contains(key) && !is_good(given, key);
}

constexpr auto table_allowed = "at least 2 numbers, strictly increasing from 0 to 1";

std::string table_fault(const std::vector<double>& table) {
  if (table.size() < 2 || table.front() != 0 || table.back() != 1)
    return "does not run from 0 to 1";
  const auto late = std::ranges::adjacent_find(table, std::greater_equal{});
  if (late == table.end()) return "";
  return "number " + std::to_string(late - table.begin() + 2) + " is not above the one before it";
}

void check_response(const ResponseCurve& curve, const std::vector<Key>& all, const GivenKeys& given,
                    Format format, Faults& faults) {
  if (is_bad(given, "kind")) return;
  const std::string kind = codec::quote(name_of(curve.kind));
  for (const Key& key : all) {
    if (!key.only_with) continue;
    const bool belongs = key.only_with == curve.kind, is_given = given.contains(key.name);
    // An author may leave gamma out: it has a default.
    const bool needed = curve.kind == ResponseCurve::Kind::table || format == Format::recorded;
    if (is_given && !belongs)
      faults.push_back({key.name, "conflicts with kind " + kind + "; allowed with " +
                                      codec::quote(name_of(*key.only_with))});
    if (!is_given && belongs && needed)
      faults.push_back(
          {key.name,
           "is missing for kind " + kind + "; allowed: " +
               (curve.kind == ResponseCurve::Kind::table ? table_allowed : key.allowed(format))});
  }
  if (curve.kind != ResponseCurve::Kind::table || !is_good(given, "table")) return;
  if (const std::string fault = table_fault(curve.inverse_table); !fault.empty())
    faults.push_back({"table", fault + "; allowed: " + table_allowed});
}

void check_angles(const LightCameraCalibration& light, const std::vector<Key>& all,
                  const GivenKeys& given, Format format, Faults& faults) {
  if (!is_good(given, "max_angle_deg")) return;
  const FisheyeIntrinsics& lens = light.intrinsics;
  const std::string up_to = " up to " + key_named(all, "max_angle_deg").spelled(format);
  const double fold = monotonic_limit_rad(lens.k);
  if (format == Format::authored && !is_bad(given, "k") && fold < lens.max_angle_rad)
    faults.push_back(
        {"k", "the lens model folds back at " +
                  codec::print_number(std::floor(fold * 1800 / std::numbers::pi) / 10) +
                  " degrees off axis; allowed: a growing radius" + up_to});
  if (is_good(given, "vignetting") &&
      !(least_illumination(light.vignetting, lens.max_angle_rad) >= min_illumination))
    faults.push_back(
        {"vignetting", "passes no light at some angle; allowed: at least 0.01 of it" + up_to});
}

std::string missing(const Key& key, Format format) {
  const std::string what = "is missing; allowed: " + key.allowed(format);
  return format == Format::authored ? what + ", like " + key.need.example : what;
}

bool is_needed(const Key& key, const Source& source) {
  if (key.table == std::string_view("lens") && !source.has_lens) return false;
  if (source.format == Format::authored) return key.need.kind == Need::Kind::required;
  return *key.recorded && !key.only_with && !key.optional_in_old_sessions &&
         !key.is_recorded_if_not_zero;
}

template <class Draft>
auto read(const Source& source) {
  Draft draft;
  GivenKeys given;
  const std::vector<Key> all = keys(draft);
  for (const Key& key : all) {
    const auto value = source.find(key);
    if (!value) {
      if (is_needed(key, source)) source.fail(key, {}, missing(key, source.format));
      continue;
    }
    try {
      std::visit([&]<class T>(T* to) { *to = Codec<T>::read(*value, key.bounds(source.format)); },
                 key.to);
      given[key.name] = true;
    } catch (const Misread& misread) {
      source.fail(key, misread.at, misread.what);
    }
  }
  for (const auto& [name, what] : check(draft, given, source.format))
    source.fail(key_named(all, name), {}, what);
  return draft.calibration;
}

}  // namespace

std::vector<KeyFault> check(ObserverDraft& draft, const GivenKeys& given, Format format) {
  Faults faults;
  check_response(draft.calibration.response, keys(draft), given, format, faults);
  const ThinLens& lens = draft.lens;
  if (is_good(given, "focus_distance_m") && is_good(given, "focal_length_mm") &&
      lens.focus_distance_m <= lens.focal_length_m)
    faults.push_back({"focus_distance_m", "must exceed the focal length; allowed: above " +
                                              codec::print_number(lens.focal_length_m) + " m"});
  if (given.contains("focal_length_mm")) draft.calibration.lens = lens;
  return faults;
}

std::vector<KeyFault> check(LightCameraDraft& draft, const GivenKeys& given, Format format) {
  Faults all = faults(draft.pose, given, "world_from_camera");
  if (all.empty())
    draft.calibration.world_from_camera = format == Format::recorded && draft.pose.matrix
                                              ? *draft.pose.matrix
                                              : rigid_transform(draft.pose);
  const std::vector<Key> vocabulary = keys(draft);
  check_response(draft.calibration.response, vocabulary, given, format, all);
  check_angles(draft.calibration, vocabulary, given, format, all);
  return all;
}

ObserverCalibration read_observer(const Source& source) {
  return read<ObserverDraft>(source);
}

LightCameraCalibration read_light_camera(const Source& source) {
  return read<LightCameraDraft>(source);
}

}  // namespace previz::calibration
