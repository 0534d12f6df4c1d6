// Measures the signal of a camera whose lens is covered.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>

#include "daemon/tools/calibrate/lens/source.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

struct DarkFit {
  glm::dvec3 level{0};  // mean signal, as a share of white: LightCameraCalibration::dark_level
  glm::dvec3 noise{0};  // standard deviation of a pixel from picture to picture; 0 with one picture
  int pictures = 0;
  std::size_t hot_pixels = 0;  // mean above the level by hot_signal; left out of `level`
};

inline constexpr double hot_signal = 0.05;

// Fits all pictures of the source, by the camera's response. Throws previz::Error if there are
// none, if they differ in size, or if light gets in: a sixty-fourth of the picture is brighter than
// the darkest one by a tenth of the level and by more than a code of 255.
DarkFit fit_dark(PictureSource& source, const ResponseCurve& response);

}  // namespace previz::calibrate
