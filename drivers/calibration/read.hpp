// Reads calibrations from files: one reader and one check serve every format.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "drivers/calibration/keys.hpp"

namespace previz::calibration {

// Checks what no key shows alone, and completes draft.calibration by its lens or pose. A key that
// could not be read is not judged again.
//
// The one difference between the formats is a fisheye whose picture folds back within its
// calibrated angle. Whoever authored it gets an error, and can correct it. A recording has to open
// for ever, and is used up to the fold (Fisheye::max_angle_rad), which the lighting notes.
std::vector<KeyFault> check(ObserverDraft& draft, const GivenKeys& given, Format format);
std::vector<KeyFault> check(LightCameraDraft& draft, const GivenKeys& given, Format format);

// A file, or the part of it, that holds a calibration.
struct Source {
  Format format = Format::authored;
  bool has_lens = false;  // there is a table for the thin lens
  std::function<std::optional<Value>(const Key&)> find;
  // Throws an Error that names the file and the key; `at` is the place of a value that is wrong.
  std::function<void(const Key&, std::optional<Position> at, const std::string& what)> fail;
};

// Fails at the first key that is missing, out of its bounds or at odds with another.
ObserverCalibration read_observer(const Source& source);
LightCameraCalibration read_light_camera(const Source& source);

}  // namespace previz::calibration
