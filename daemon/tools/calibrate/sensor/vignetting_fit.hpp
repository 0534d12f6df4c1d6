// Fits the light that a fisheye loses towards its edge, from pictures of something evenly lit.
#pragma once

#include <string>
#include <vector>

#include "daemon/tools/calibrate/lens/source.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

struct FlatSample {
  double x = 0, y = 0;   // unit direction, camera axes
  double angle_rad = 0;  // off axis
  double signal = 0;     // sum of the channels, minus the dark level
};

struct FlatPicture {
  std::string name;
  std::vector<FlatSample> samples;
  double rms = 0;  // residual, as a share of the signal
};

struct VignettingFit {
  Vignetting vignetting{};
  double widest_rad = 0;  // angle off axis of the widest sample
  double rms = 0;         // over all pictures, as a share of the signal
};

// Reads the signals of up to 20 000 pixels over the picture, none of them black or white, at most
// the calibrated angle off axis. `notes` says what is left out.
std::vector<FlatPicture> read_flat_pictures(PictureSource& source,
                                            const LightCameraCalibration& camera,
                                            std::vector<std::string>& notes);

// Models each picture as L (1 + g . d) V(t): even light with a gradient g of its own across the
// camera's x and y (a wall is hardly ever lit as evenly as this requires), times what the lens lets
// through. V is common to all pictures. Least squares alternate: level and gradient of each
// picture, then V. Throws previz::Error if there are no samples, or V leaves less than
// min_illumination somewhere up to max_angle_rad.
VignettingFit fit_vignetting(std::vector<FlatPicture>& pictures, double max_angle_rad);

}  // namespace previz::calibrate
