// What a fisheye loses towards its edge, from pictures of something evenly lit.
#pragma once

#include <string>
#include <vector>

#include "daemon/calibrate/source.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

struct FlatSample {
  double x = 0, y = 0;   // of its unit direction, camera axes
  double angle_rad = 0;  // off axis
  double signal = 0;     // dark level taken off; of the channels' sum
};

struct FlatPicture {
  std::string name;
  std::vector<FlatSample> samples;
  double rms = 0;  // of what the fit leaves, as a share of the signal
};

struct VignettingFit {
  Vignetting vignetting{};
  double widest_rad = 0;  // angle off axis of the widest sample
  double rms = 0;         // over all pictures, as a share of the signal
};

// Signals of up to 20 000 pixels over the picture, none of them black or white, at most the
// calibrated angle off axis. `notes` says what is left out.
std::vector<FlatPicture> read_flat_pictures(PictureSource& source,
                                            const LightCameraCalibration& camera,
                                            std::vector<std::string>& notes);

// Each picture is a L (1 + g . d) V(t): even light but for a gradient g of its own across the
// camera's x and y (a wall is hardly lit as evenly as this asks for), times what the lens lets
// through. V comes of all pictures, by least squares in turns: level and gradient of each, then V.
// Throws previz::Error if there are no samples, or V leaves less than min_illumination somewhere up
// to max_angle_rad.
VignettingFit fit_vignetting(std::vector<FlatPicture>& pictures, double max_angle_rad);

}  // namespace previz::calibrate
