#include "daemon/core/set/pose.hpp"

#include <cmath>
#include <glm/geometric.hpp>

#include "drivers/calibration/pose.hpp"

namespace previz::set {

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

}  // namespace previz::set
