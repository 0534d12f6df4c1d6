// The observer camera of the reference tracer: exact inverse distortion, thin lens.
#pragma once

#include <glm/mat4x4.hpp>

#include "drivers/calibration.hpp"
#include "tests/truth/cpu_geometry.hpp"
#include "tests/truth/cpu_random.hpp"

namespace previz::truth {

// The same camera with a picture `factor` times the size (0.25: a quarter of the width), so that
// one pixel covers exactly 1/factor x 1/factor of the old ones.
ObserverCalibration resized(const ObserverCalibration& calibration, double factor);

// Undistorted direction with z = 1, camera axes. Newton on the distortion model; throws
// previz::Error naming the pixel where it does not converge.
glm::dvec3 undistorted_direction(const PinholeIntrinsics& intrinsics, double u, double v);

// A ray through picture position (u, v), the lens sampled at random; camera axes.
Ray camera_ray(const ObserverCalibration& calibration, double u, double v, Random& random);

}  // namespace previz::truth
