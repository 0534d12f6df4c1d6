#include "drivers/calibration/pinhole.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

namespace previz {
namespace {

// Coefficients of 1, s, s^2, ..., where s is the square of the distance off the axis.
template <std::size_t N>
using Polynomial = std::array<double, N>;

Polynomial<4> dividend(const PinholeIntrinsics& lens) {
  return {1, lens.k1, lens.k2, lens.k3};
}

Polynomial<4> divisor(const PinholeIntrinsics& lens) {
  return {1, lens.k4, lens.k5, lens.k6};
}

// Returns the dividend of the derivative of r n(r^2) / d(r^2), n d + 2 s (n' d - n d'); its divisor
// is d^2.
Polynomial<7> growth(const PinholeIntrinsics& lens) {
  const Polynomial<4> n = dividend(lens), d = divisor(lens);
  Polynomial<7> result{};
  for (std::size_t i = 0; i < 4; ++i)
    for (std::size_t j = 0; j < 4; ++j)
      result[i + j] += (1 + 2 * (static_cast<double>(i) - static_cast<double>(j))) * n[i] * d[j];
  return result;
}

// Returns the coefficients of a polynomial over [0, end] in the basis of Bernstein, whose first and
// last are its values at the ends, and whose hull contains the others (Farouki 2012, section 3).
template <std::size_t N>
Polynomial<N> bernstein(Polynomial<N> p, double end) {
  double scale = 1, binomial = 1;
  for (std::size_t i = 0; i < N; ++i) {
    p[i] *= scale / binomial;
    scale *= end;
    binomial *= static_cast<double>(N - 1 - i) / static_cast<double>(i + 1);
  }
  for (std::size_t round = 1; round < N; ++round)
    for (std::size_t i = N - 1; i >= round; --i) p[i] += p[i - 1];
  return p;
}

// Returns whether a polynomial in the basis of Bernstein is above `least` all over its interval,
// which is halved (de Casteljau) until that is decided.
template <std::size_t N>
bool is_above(double least, Polynomial<N> right, int halvings) {
  if (std::ranges::all_of(right, [&](double b) { return b > least; })) return true;
  if (!(right.front() > least && right.back() > least) || halvings == 0) return false;
  Polynomial<N> left;
  for (std::size_t round = 0; round < N; ++round) {
    left[round] = right[0];
    for (std::size_t i = 0; i + round + 1 < N; ++i) right[i] = (right[i] + right[i + 1]) / 2;
  }
  return is_above(least, left, halvings - 1) && is_above(least, right, halvings - 1);
}

// Returns whether a polynomial is above 0 all over [0, end], by more than its terms are rounded.
template <std::size_t N>
bool is_above_zero(const Polynomial<N>& p, double end) {
  double terms = 0, below = 0, scale = 1;
  for (const double coefficient : p) {
    terms += std::abs(coefficient) * scale;
    below += std::min(coefficient, 0.0) * scale;
    scale *= end;
  }
  const double least = 1e-14 * terms;
  if (p[0] + below > least) return true;  // as most are
  return is_above(least, bernstein(p, end), 50);
}

glm::dvec2 without_distortion(const PinholeIntrinsics& lens, glm::dvec2 pixel) {
  return {(pixel.x - lens.cx) / lens.fx, (pixel.y - lens.cy) / lens.fy};
}

}  // namespace

glm::dvec2 distort(const PinholeIntrinsics& lens, glm::dvec2 normalised, glm::dmat2* jacobian) {
  const double x = normalised.x, y = normalised.y;
  const double r2 = x * x + y * y;
  const double shrink = 1 / (1 + r2 * (lens.k4 + r2 * (lens.k5 + r2 * lens.k6)));
  const double radial = (1 + r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3))) * shrink;
  const double xd = x * radial + 2 * lens.p1 * x * y + lens.p2 * (r2 + 2 * x * x);
  const double yd = y * radial + lens.p1 * (r2 + 2 * y * y) + 2 * lens.p2 * x * y;
  if (jacobian) {
    const double dividend_slope = lens.k1 + r2 * (2 * lens.k2 + r2 * 3 * lens.k3);
    const double divisor_slope = lens.k4 + r2 * (2 * lens.k5 + r2 * 3 * lens.k6);
    const double slope =
        2 * (dividend_slope - radial * divisor_slope) * shrink;  // dradial/dx over x
    const double cross = x * y * slope + 2 * lens.p1 * x + 2 * lens.p2 * y;
    const double dxdx = radial + x * x * slope + 2 * lens.p1 * y + 6 * lens.p2 * x;
    const double dydy = radial + y * y * slope + 6 * lens.p1 * y + 2 * lens.p2 * x;
    *jacobian = glm::dmat2(lens.fx * dxdx, lens.fy * cross, lens.fx * cross, lens.fy * dydy);
  }
  return {lens.fx * xd + lens.cx, lens.fy * yd + lens.cy};
}

std::optional<glm::dvec2> undistort(const PinholeIntrinsics& lens, glm::dvec2 pixel) {
  glm::dvec2 x = without_distortion(lens, pixel);
  for (int i = 0; i < 20; ++i) {
    glm::dmat2 jacobian;
    const glm::dvec2 error = distort(lens, x, &jacobian) - pixel;
    if (!(glm::determinant(jacobian) > 0)) return std::nullopt;
    if (glm::length(error) < 1e-9)
      return is_unfolded(lens, x, pixel) ? std::optional(x) : std::nullopt;
    x -= glm::inverse(jacobian) * error;
  }
  return std::nullopt;
}

bool is_unfolded(const PinholeIntrinsics& lens, glm::dvec2 normalised, glm::dvec2 pixel) {
  const glm::dvec2 straight = without_distortion(lens, pixel);
  const double point_r2 = glm::dot(normalised, normalised);
  const double most_r2 = std::max(point_r2, glm::dot(straight, straight));
  return is_above_zero(divisor(lens), most_r2) && is_above_zero(growth(lens), point_r2);
}

}  // namespace previz
