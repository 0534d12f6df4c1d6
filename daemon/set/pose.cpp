#include "daemon/set/pose.hpp"

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>

namespace previz::set {

glm::dmat4 pose(const glm::dvec3& position, const glm::dvec3& angles_rad) {
  auto out = glm::translate(glm::dmat4{1}, position);
  out = glm::rotate(out, angles_rad.z, {0, 0, 1});
  out = glm::rotate(out, angles_rad.y, {0, 1, 0});
  return glm::rotate(out, angles_rad.x, {1, 0, 0});
}

double rigidity_error(const glm::dmat4& transform) {
  const glm::dmat3 r(transform);
  if (!(glm::determinant(r) > 0)) return std::numeric_limits<double>::infinity();
  const auto excess = glm::transpose(r) * r - glm::dmat3{1};
  double worst = 0;
  for (int c = 0; c < 3; ++c)
    for (int i = 0; i < 3; ++i) worst = std::max(worst, std::abs(excess[c][i]));
  return worst;
}

glm::dmat4 nearest_rigid(const glm::dmat4& transform) {
  glm::dmat3 r(transform);
  // Quadratic once near; 60 halvings reach any scale a double can hold a square of.
  for (int i = 0; i < 60 && rigidity_error(glm::dmat4(r)) > 1e-15; ++i)
    r = 0.5 * (r + glm::transpose(glm::inverse(r)));
  glm::dmat4 out(r);
  out[3] = transform[3];
  return out;
}

double regularity(const glm::dmat4& transform) {
  const glm::dmat3 a(transform);
  const double x = glm::length(a[0]), y = glm::length(a[1]), z = glm::length(a[2]);
  if (x == 0 || y == 0 || z == 0) return 0;
  return std::abs(glm::dot(a[0] / x, glm::cross(a[1] / y, a[2] / z)));
}

std::optional<FittedSquare> fit_square(const std::array<glm::dvec3, 4>& corners) {
  const auto& [lower_left, lower_right, upper_right, upper_left] = corners;
  const auto right = 0.5 * (lower_right - lower_left + upper_right - upper_left);
  const auto up = 0.5 * (upper_left - lower_left + upper_right - lower_right);
  const auto out_of_paper = glm::cross(right, up);
  const double area = glm::length(out_of_paper);
  const double size = 0.5 * (glm::length(right) + glm::length(up));
  if (!(area > 1e-6 * size * size)) return std::nullopt;

  FittedSquare fit;
  fit.size = size;
  fit.world_from_tag =
      nearest_rigid(glm::dmat4(glm::dmat3(right / size, up / size, out_of_paper / area)));
  fit.world_from_tag[3] =
      glm::dvec4(0.25 * (lower_left + lower_right + upper_right + upper_left), 1.0);
  fit.error = 0;
  constexpr std::array<glm::dvec2, 4> unit{{{-0.5, -0.5}, {0.5, -0.5}, {0.5, 0.5}, {-0.5, 0.5}}};
  for (std::size_t i = 0; i < 4; ++i) {
    const glm::dvec3 ideal(fit.world_from_tag * glm::dvec4(size * unit[i], 0.0, 1.0));
    fit.error = std::max(fit.error, glm::distance(ideal, corners[i]) / size);
  }
  return fit;
}

std::optional<double> fold_angle(const FisheyeIntrinsics& intrinsics) {
  const auto& k = intrinsics.k;
  const auto slope = [&k](double t) {
    const double s = t * t;
    return 1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])));
  };
  constexpr int steps = 4096;  // the slope has at most 4 extrema; a dip narrower than this is flat
  double safe = 0;
  for (int i = 1; i <= steps; ++i) {
    const double t = intrinsics.max_angle_rad * i / steps;
    if (slope(t) > 0) {
      safe = t;
      continue;
    }
    double folded = t;
    for (int halving = 0; halving < 60; ++halving) {
      const double middle = 0.5 * (safe + folded);
      (slope(middle) > 0 ? safe : folded) = middle;
    }
    return folded;
  }
  return std::nullopt;
}

}  // namespace previz::set
