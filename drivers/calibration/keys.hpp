// The vocabulary of a camera's calibration: each key is written once, with its spelling in every
// format, its unit, its bounds and its meaning.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "drivers/calibration.hpp"
#include "drivers/calibration/pose.hpp"
#include "drivers/keys/value.hpp"

namespace previz {

constexpr auto names(ResponseCurve::Kind) {
  return std::to_array<Name<ResponseCurve::Kind>>({{"srgb", ResponseCurve::Kind::srgb},
                                                   {"linear", ResponseCurve::Kind::linear},
                                                   {"gamma", ResponseCurve::Kind::gamma},
                                                   {"table", ResponseCurve::Kind::table}});
}

namespace calibration {

inline constexpr int max_picture_side_px = 16384;
// A distance that a lens cannot tell from infinity, but a float still can.
inline constexpr double far_m = 1e6;

// Set files and FRAMES.json are authored: people write them, in the units that a key's name ends
// in, and may leave keys out. session.toml is recorded: previzd writes every key of it, but for
// those that older versions do not know and that are 0, in the units and to the last bit of the
// structs.
enum class Format { authored, recorded };

struct ObserverDraft {
  ObserverCalibration calibration;  // without its lens
  ThinLens lens;
};

struct LightCameraDraft {
  LightCameraCalibration calibration;  // without its pose
  PoseDraft pose;
};

// A key, bound to the place of its value in a draft.
struct Key {
  using Place = std::variant<int*, double*, std::array<double, 3>*, std::array<double, 4>*,
                             glm::dvec3*, std::vector<double>*, ResponseCurve::Kind*,
                             std::optional<glm::dvec3>*, std::optional<glm::dmat4>*>;
  const char* table;  // of an authored format: "intrinsics"
  const char* name;   // in that table
  Place to;
  Rule rule;  // in the unit of an authored format
  const char* about;
  Need need{};                                     // in an authored format
  const char* recorded = name;                     // its path in session.toml; "": not there
  std::optional<ResponseCurve::Kind> only_with{};  // goes with this kind of response only
  bool optional_in_old_sessions = false;           // was not recorded from the beginning
  // Sessions have such keys only if one of them is not 0. They are numbers.
  bool is_recorded_if_not_zero = false;

  std::string spelled(Format format) const { return format == Format::recorded ? recorded : name; }
  Rule bounds(Format format) const { return format == Format::recorded ? rule.in_si() : rule; }
  // The type, unit and bounds in words.
  std::string allowed(Format format) const;
};

// Every key of a calibration, in the order of the set file's tables and of session.toml's.
std::vector<Key> keys(ObserverDraft& draft);
std::vector<Key> keys(LightCameraDraft& draft);

}  // namespace calibration
}  // namespace previz
