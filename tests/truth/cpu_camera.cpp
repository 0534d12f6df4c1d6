#include "tests/truth/cpu_camera.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat2x2.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <string>

#include "drivers/error.hpp"

namespace previz::truth {
namespace {

double divisor_of(const PinholeIntrinsics& k, double r2) {
  return 1 + r2 * (k.k4 + r2 * (k.k5 + r2 * k.k6));
}

double radial_of(const PinholeIntrinsics& k, double r2) {
  return (1 + r2 * (k.k1 + r2 * (k.k2 + r2 * k.k3))) / divisor_of(k, r2);
}

// Returns where the normalised point (x, y) lands, by the rational model as OpenCV defines it.
glm::dvec2 distort(const PinholeIntrinsics& k, const glm::dvec2& p) {
  const double r2 = glm::dot(p, p);
  const double radial = radial_of(k, r2);
  return {p.x * radial + 2 * k.p1 * p.x * p.y + k.p2 * (r2 + 2 * p.x * p.x),
          p.y * radial + k.p1 * (r2 + 2 * p.y * p.y) + 2 * k.p2 * p.x * p.y};
}

glm::dmat2 distort_jacobian(const PinholeIntrinsics& k, const glm::dvec2& p) {
  const double r2 = glm::dot(p, p);
  const double radial = radial_of(k, r2);
  const double dividend_slope = k.k1 + r2 * (2 * k.k2 + r2 * 3 * k.k3);
  const double divisor_slope = k.k4 + r2 * (2 * k.k5 + r2 * 3 * k.k6);
  // d radial / d r2, doubled.
  const double slope = 2 * (dividend_slope - radial * divisor_slope) / divisor_of(k, r2);
  const double cross = slope * p.x * p.y + 2 * k.p1 * p.x + 2 * k.p2 * p.y;
  return {{radial + slope * p.x * p.x + 2 * k.p1 * p.y + 6 * k.p2 * p.x, cross},
          {cross, radial + slope * p.y * p.y + 6 * k.p1 * p.y + 2 * k.p2 * p.x}};
}

}  // namespace

ObserverCalibration resized(const ObserverCalibration& calibration, double factor) {
  ObserverCalibration out = calibration;
  PinholeIntrinsics& k = out.intrinsics;
  k.width = static_cast<int>(std::lround(k.width * factor));
  k.height = static_cast<int>(std::lround(k.height * factor));
  k.fx *= factor;
  k.fy *= factor;
  k.cx = (k.cx + 0.5) * factor - 0.5;
  k.cy = (k.cy + 0.5) * factor - 0.5;
  return out;
}

glm::dvec3 undistorted_direction(const PinholeIntrinsics& intrinsics, double u, double v) {
  const glm::dvec2 target((u - intrinsics.cx) / intrinsics.fx, (v - intrinsics.cy) / intrinsics.fy);
  glm::dvec2 p = target;
  for (int i = 0; i < 50; ++i) {
    const glm::dvec2 residual = distort(intrinsics, p) - target;
    if (glm::length(residual) < 1e-13) return {p, 1};
    p -= glm::inverse(distort_jacobian(intrinsics, p)) * residual;
  }
  throw Error("reference tracer: the lens distortion cannot be inverted at pixel (" +
              std::to_string(u) + ", " + std::to_string(v) + ")");
}

Ray camera_ray(const ObserverCalibration& calibration, double u, double v, Random& random) {
  const glm::dvec3 direction = undistorted_direction(calibration.intrinsics, u, v);
  if (!calibration.lens) return {glm::dvec3(0), glm::normalize(direction)};
  const ThinLens& lens = *calibration.lens;
  const glm::dvec2 sample = random.uniform2();
  const double r = 0.5 * lens.focal_length_m / lens.f_number * std::sqrt(sample.x);
  const double phi = 2 * std::numbers::pi * sample.y;
  const glm::dvec3 origin(r * std::cos(phi), r * std::sin(phi), 0);
  return {origin, glm::normalize(direction * lens.focus_distance_m - origin)};
}

}  // namespace previz::truth
