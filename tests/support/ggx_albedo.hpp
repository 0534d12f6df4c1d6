// The share of light that a rough conductor sends back, by a quadrature that is neither the
// renderer's nor the reference tracer's.
#pragma once

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace previz::test {

// Directional albedo of GGX with Schlick's reflectance f0, by quadrature over the half vector's
// hemisphere (Walter et al. 2007; height-correlated Smith, Heitz 2014). Single scattering only.
inline double ggx_albedo(double cos_o, double alpha, double f0) {
  const glm::dvec3 o(std::sqrt(1 - cos_o * cos_o), 0, cos_o);
  const auto lambda = [&](double z) {
    return 0.5 * (std::sqrt(1 + alpha * alpha * (1 - z * z) / (z * z)) - 1);
  };
  constexpr int steps = 2000;
  constexpr double pi = std::numbers::pi;
  double sum = 0;
  for (int a = 0; a < steps; ++a) {
    // The half vector's tangent is alpha tan(pi u / 2): even steps where the lobe is.
    const double angle = (a + 0.5) / steps * pi / 2;
    const double tangent = alpha * std::tan(angle);
    const double z = 1 / std::sqrt(1 + tangent * tangent);
    const double dtheta = alpha / (std::cos(angle) * std::cos(angle)) * z * z * pi / 2 / steps;
    const double d = 1 / (pi * alpha * alpha * std::pow(z, 4) *
                          std::pow(1 + tangent * tangent / (alpha * alpha), 2));
    for (int b = 0; b < 400; ++b) {
      const double phi = (b + 0.5) / 400 * 2 * pi;
      const glm::dvec3 h(z * tangent * std::cos(phi), z * tangent * std::sin(phi), z);
      const double oh = glm::dot(o, h);
      const glm::dvec3 i = 2 * oh * h - o;
      if (oh <= 0 || i.z <= 0) continue;
      const double masking = 1 / (1 + lambda(cos_o) + lambda(i.z));
      const double reflectance = f0 + (1 - f0) * std::pow(1 - oh, 5);
      // dw_i = 4 (o.h) dw_h
      sum += reflectance * d * masking / (4 * cos_o) * 4 * oh * z * tangent * dtheta * 2 * pi / 400;
    }
  }
  return sum;
}

}  // namespace previz::test
