#include "drivers/calibration/fisheye.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>
#include <vector>

namespace previz {
namespace {

using std::numbers::pi;

double radius(const std::array<double, 4>& k, double angle) {
  const double x = angle * angle;
  return angle * (1 + x * (k[0] + x * (k[1] + x * (k[2] + x * k[3]))));
}

double radius_slope(const std::array<double, 4>& k, double angle) {
  const double x = angle * angle;
  return 1 + x * (3 * k[0] + x * (5 * k[1] + x * (7 * k[2] + x * 9 * k[3])));
}

// Coefficients in rising powers.
double evaluate(const std::vector<double>& polynomial, double x) {
  double value = 0;
  for (auto c = polynomial.rbegin(); c != polynomial.rend(); ++c) value = value * x + *c;
  return value;
}

// Roots in (0, end) at which the sign changes, in rising order: between two neighbouring roots of
// the derivative a polynomial is monotonic and holds at most one.
std::vector<double> sign_changes(const std::vector<double>& polynomial, double end) {
  if (polynomial.size() < 2) return {};
  std::vector<double> derivative;
  for (std::size_t i = 1; i < polynomial.size(); ++i)
    derivative.push_back(static_cast<double>(i) * polynomial[i]);
  std::vector<double> bounds = sign_changes(derivative, end);
  bounds.push_back(end);
  std::vector<double> roots;
  double low = 0;
  for (const double bound : bounds) {
    double a = low, b = bound;
    low = bound;
    const bool rising = evaluate(polynomial, a) < 0;
    if (rising == (evaluate(polynomial, b) < 0)) continue;
    for (int i = 0; i < 100 && a < b; ++i) {
      const double middle = 0.5 * (a + b);
      ((evaluate(polynomial, middle) < 0) == rising ? a : b) = middle;
    }
    roots.push_back(0.5 * (a + b));
  }
  return roots;
}

}  // namespace

double monotonic_limit_rad(const std::array<double, 4>& k) {
  const auto roots = sign_changes({1, 3 * k[0], 5 * k[1], 7 * k[2], 9 * k[3]}, pi * pi);
  return roots.empty() ? pi : std::sqrt(roots.front());
}

glm::dvec2 fisheye_pixel(const FisheyeIntrinsics& intrinsics, const glm::dvec3& direction) {
  const double off_axis = std::hypot(direction.x, direction.y);
  if (off_axis == 0) return {intrinsics.cx, intrinsics.cy};
  const double scale = radius(intrinsics.k, std::atan2(off_axis, direction.z)) / off_axis;
  return {intrinsics.cx + intrinsics.fx * scale * direction.x,
          intrinsics.cy + intrinsics.fy * scale * direction.y};
}

Fisheye::Fisheye(const FisheyeIntrinsics& intrinsics) : intrinsics_(intrinsics) {
  assert(intrinsics.width > 0 && intrinsics.height > 0 && intrinsics.fx > 0 && intrinsics.fy > 0);
  assert(intrinsics.max_angle_rad > 0 && intrinsics.max_angle_rad <= pi);
  max_angle_rad_ = std::min(intrinsics.max_angle_rad, monotonic_limit_rad(intrinsics.k));
  max_radius_ = radius(intrinsics.k, max_angle_rad_);
}

std::optional<glm::dvec2> Fisheye::project(const glm::dvec3& direction) const {
  const double off_axis = std::hypot(direction.x, direction.y);
  const double angle = std::atan2(off_axis, direction.z);
  if (!(angle <= max_angle_rad_)) return std::nullopt;
  if (off_axis == 0 && !(direction.z > 0)) return std::nullopt;
  return fisheye_pixel(intrinsics_, direction);
}

std::optional<glm::dvec3> Fisheye::unproject(const glm::dvec2& pixel) const {
  const double x = (pixel.x - intrinsics_.cx) / intrinsics_.fx;
  const double y = (pixel.y - intrinsics_.cy) / intrinsics_.fy;
  const double r = std::hypot(x, y);
  if (!(r <= max_radius_)) return std::nullopt;
  if (r == 0) return glm::dvec3(0, 0, 1);

  // Newton's method, kept inside a bracket that every step shrinks.
  double low = 0, high = max_angle_rad_;
  double angle = std::min(r, high);
  for (int i = 0; i < 100; ++i) {
    const double error = radius(intrinsics_.k, angle) - r;
    (error > 0 ? high : low) = angle;
    double next = angle - error / radius_slope(intrinsics_.k, angle);
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    const double step = std::abs(next - angle);
    angle = next;
    if (step <= 1e-15 * angle) break;
  }
  const double sine = std::sin(angle);
  return glm::dvec3(sine * x / r, sine * y / r, std::cos(angle));
}

std::optional<std::uint32_t> Fisheye::pixel_at(const glm::dvec2& position) const {
  if (!(position.x >= -0.5 && position.y >= -0.5 && position.x < intrinsics_.width - 0.5 &&
        position.y < intrinsics_.height - 0.5))
    return std::nullopt;
  const auto x = static_cast<std::uint32_t>(std::floor(position.x + 0.5));
  const auto y = static_cast<std::uint32_t>(std::floor(position.y + 0.5));
  const double far_x = (std::abs(x - intrinsics_.cx) + 0.5) / intrinsics_.fx;
  const double far_y = (std::abs(y - intrinsics_.cy) + 0.5) / intrinsics_.fy;
  if (far_x * far_x + far_y * far_y > max_radius_ * max_radius_) return std::nullopt;
  return y * static_cast<std::uint32_t>(intrinsics_.width) + x;
}

}  // namespace previz
