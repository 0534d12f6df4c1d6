// Finds the thin lens that depth of field needs, from what the crew and the picture say about the
// film camera's lens.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/tools/calibrate/lens/exif.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

// The facts about a lens. A stated value takes precedence over a photograph's EXIF, and that over a
// computed value.
struct LensFacts {
  std::optional<double> focal_length_m;
  std::optional<double> f_number;
  std::optional<double> focus_distance_m;  // from the entrance pupil, along the axis
  std::optional<double> sensor_width_m;    // of the part that the picture shows
  std::optional<PinholeIntrinsics> intrinsics;
  std::optional<PhotoData> photo;
};

struct LensFound {
  ThinLens lens;
  std::vector<std::string> notes;  // where each number is from, and what contradicts what
};

// A focal length that is not stated follows from the calibration and the sensor: fx pixels are the
// distance v of the image, and 1/f = 1/v + 1/d (thin lens) with the focus at d. If one is stated
// too, a difference of more than 5 % is noted. Throws previz::Error naming what is missing.
LensFound find_lens(const LensFacts& facts);

// The range that is sharp: the nearest and the farthest distance whose circle of confusion is at
// most `circle_px` in a picture of these intrinsics; the farthest may be infinite. With the
// aperture's diameter A and the focus at d, a point at distance z makes a circle of fx A |1/d -
// 1/z| pixels (the sensor is where fx says).
struct SharpRange {
  double near_m = 0, far_m = 0;
};
SharpRange sharp_range(const ThinLens& lens, double fx, double circle_px);

}  // namespace previz::calibrate
