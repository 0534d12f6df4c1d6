#include "daemon/core/render/passes/photon_schedule.hpp"

#include <algorithm>
#include <cmath>

namespace previz::render {

double photon_radius_factor(std::uint64_t pass) {
  // This is the product of (k + alpha) / (k + 1) for k = 1 .. pass.
  constexpr double alpha = 2.0 / 3.0;
  const double n = static_cast<double>(pass) + 1;
  const double log_squared = std::lgamma(n + alpha) - std::lgamma(1 + alpha) - std::lgamma(n + 1);
  return std::exp(0.5 * log_squared);
}

std::uint32_t photon_count(double photons_per_pixel, int width, int height, std::uint32_t most) {
  const double wanted = std::max(photons_per_pixel * width * height, 1024.0);
  return static_cast<std::uint32_t>(std::min(wanted, static_cast<double>(most)));
}

}  // namespace previz::render
