#include "drivers/calibration.hpp"

#include <algorithm>
#include <cmath>

namespace previz {
namespace {

double at_square(const Vignetting& v, double x) {
  return 1 + x * (v[0] + x * (v[1] + x * v[2]));
}

}  // namespace

double srgb_signal(double value) {
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

double relative_illumination(const Vignetting& v, double angle_rad) {
  return at_square(v, angle_rad * angle_rad);
}

double least_illumination(const Vignetting& v, double max_angle_rad) {
  const double end = max_angle_rad * max_angle_rad;
  double least = std::min(1.0, at_square(v, end));
  const auto consider = [&](double x) {
    if (x > 0 && x < end) least = std::min(least, at_square(v, x));
  };
  // The extremes lie where the slope v1 + 2 v2 x + 3 v3 x^2 is 0; q never cancels (Numerical
  // Recipes, 5.6).
  const double discriminant = v[1] * v[1] - 3 * v[0] * v[2];
  if (discriminant >= 0) {
    const double q = -(v[1] + std::copysign(std::sqrt(discriminant), v[1]));
    if (v[2] != 0) consider(q / (3 * v[2]));
    if (q != 0) consider(v[0] / q);
  }
  return least;
}

}  // namespace previz
