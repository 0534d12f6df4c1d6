// Finds how an environment is turned about the vertical, from the shading and the shadows that the
// film camera sees on real surfaces.
#pragma once

#include <functional>

#include "daemon/tools/calibrate/sensor/surface_pixels.hpp"

namespace previz::calibrate {

// How far the shading of the model is from that of the picture, whatever the colours of surfaces
// and the brightness of the light are.
struct ShadingOff {
  double mean_square = 0;  // of the logarithm, in squares of a surface around its median in a frame
  std::size_t patches = 0;  // squares
};
ShadingOff shading_off(const SurfacePixels& seen);

struct RotationFit {
  double rotation_rad = 0;  // counter-clockwise from above, -pi to pi
  double sigma_rad = 0;
  double off = 0;           // root of the mean square there
  double off_unturned = 0;  // where the environment is not turned
  // The root of the best rotation at least 45 degrees away, over `off`: near 1, two rotations fit
  // alike, or no shadow tells them apart.
  double second = 1;
  bool is_certain() const { return second > 1.1; }
};

// Compares the pictures under the environment turned by an angle (rad), with so many samples per
// pixel.
using ShadingAt = std::function<ShadingOff(double rotation_rad, int samples)>;

// Renders frames of the take, spread over it, `width` pixels wide, under its set's environment. The
// take and the scene must outlive the result. Throws previz::Error as probed_shots() does.
ShadingAt shading_of(const pipeline::Take& take, const scene::Scene& scene,
                     const std::shared_ptr<render::Device>& device, int frames, int width);

// Tries all around in steps of 15 degrees, and then goes on from the best one to a degree and less.
RotationFit fit_rotation(const ShadingAt& shading_at);

}  // namespace previz::calibrate
