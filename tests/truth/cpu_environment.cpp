#include "tests/truth/cpu_environment.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <numbers>

#include "tests/truth/cpu_luminance.hpp"

namespace previz::truth {

using std::numbers::pi;

glm::dvec3 octahedral_direction_fp64(glm::dvec2 point) {
  const double u = std::abs(point.x);
  const double v = std::abs(point.y);
  const double distance = 1 - u - v;
  const double r = 1 - std::abs(distance);
  const double phi = r == 0 ? 0 : ((v - u) / r + 1) * pi / 4;
  const double sin_theta = r * std::sqrt(2 - r * r);
  return {std::copysign(std::cos(phi) * sin_theta, point.x),
          std::copysign(std::sin(phi) * sin_theta, point.y), std::copysign(1 - r * r, distance)};
}

glm::dvec2 octahedral_point_fp64(glm::dvec3 direction) {
  const double x = std::abs(direction.x);
  const double y = std::abs(direction.y);
  const double r = std::sqrt((x * x + y * y) / (1 + std::abs(direction.z)));
  double v = std::atan2(y, x) * 2 / pi * r;
  double u = r - v;
  if (direction.z < 0) {
    const double upper_u = u;
    u = 1 - v;
    v = 1 - upper_u;
  }
  return {std::copysign(u, direction.x), std::copysign(v, direction.y)};
}

Environment::Environment(const lighting::EnvironmentMap& map)
    : size_(map.size), radiance_(map.radiance) {
  cumulative_.reserve(radiance_.size());
  double sum = 0;
  for (int j = 0; j < size_; ++j) {
    for (int i = 0; i < size_; ++i) {
      for (int dj = -1; dj <= 1; ++dj) {
        for (int di = -1; di <= 1; ++di) sum += luminance(texel(i + di, j + dj));
      }
      cumulative_.push_back(sum);
    }
  }
  if (sum == 0) cumulative_.clear();
  for (double& value : cumulative_) value /= sum;
}

glm::dvec3 Environment::texel(int i, int j) const {
  // Over the edge u = +1 at v: (u, v) -> (2 - u, -v); the other edges alike.
  if (i < 0 || i >= size_) {
    i = i < 0 ? -1 - i : 2 * size_ - 1 - i;
    j = size_ - 1 - j;
  }
  if (j < 0 || j >= size_) {
    j = j < 0 ? -1 - j : 2 * size_ - 1 - j;
    i = size_ - 1 - i;
  }
  return radiance_[static_cast<std::size_t>(j) * static_cast<std::size_t>(size_) +
                   static_cast<std::size_t>(i)];
}

glm::dvec3 Environment::radiance(const glm::dvec3& direction) const {
  if (size_ == 0) return glm::dvec3(0);
  const glm::dvec2 p = (octahedral_point_fp64(direction) + 1.0) * (0.5 * size_) - 0.5;
  const glm::dvec2 low = glm::floor(p);
  const glm::dvec2 f = p - low;
  const int i = static_cast<int>(low.x);
  const int j = static_cast<int>(low.y);
  return (1 - f.y) * ((1 - f.x) * texel(i, j) + f.x * texel(i + 1, j)) +
         f.y * ((1 - f.x) * texel(i, j + 1) + f.x * texel(i + 1, j + 1));
}

DirectionSample Environment::sample(glm::dvec2 random) const {
  const auto found = std::upper_bound(cumulative_.begin(), cumulative_.end(), random.x);
  const auto index = std::min<std::size_t>(static_cast<std::size_t>(found - cumulative_.begin()),
                                           cumulative_.size() - 1);
  const double low = index == 0 ? 0 : cumulative_[index - 1];
  const double share = cumulative_[index] - low;
  const auto size = static_cast<std::size_t>(size_);
  const std::size_t i = index % size, j = index / size;
  const glm::dvec2 corner(static_cast<double>(i), static_cast<double>(j));
  const glm::dvec2 inside(std::clamp((random.x - low) / share, 0.0, 1.0), random.y);
  const glm::dvec2 point = (corner + inside) * (2.0 / size_) - 1.0;
  return {octahedral_direction_fp64(point), share * size_ * size_ / (4 * pi)};
}

double Environment::pdf(const glm::dvec3& direction) const {
  if (black()) return 0;
  const glm::dvec2 p = (octahedral_point_fp64(direction) + 1.0) * (0.5 * size_);
  const auto size = static_cast<std::size_t>(size_);
  const std::size_t i = static_cast<std::size_t>(std::clamp(p.x, 0.0, size_ - 0.5));
  const std::size_t j = static_cast<std::size_t>(std::clamp(p.y, 0.0, size_ - 0.5));
  const std::size_t index = j * size + i;
  const double share = cumulative_[index] - (index == 0 ? 0 : cumulative_[index - 1]);
  return share * size_ * size_ / (4 * pi);
}

}  // namespace previz::truth
