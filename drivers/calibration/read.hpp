// Reads calibrations from files: one reader and one check serve every format.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "drivers/calibration/keys.hpp"

namespace previz::calibration {

// Checks what only several keys together show (a response table's length, a lens shorter than its
// focus), and completes draft.calibration by its lens or pose. Says nothing more of a key that
// could not be read.
//
// A fisheye may be described so that beyond some angle the picture runs inwards again ("folds
// back"). If that angle lies within the calibrated one, a set file is refused, because its author
// can mend it. A recording has to open for ever: it is used up to that angle
// (Fisheye::max_angle_rad), and the lighting says so.
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
