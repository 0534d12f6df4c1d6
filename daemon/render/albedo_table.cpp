#include "daemon/render/albedo_table.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <numbers>

#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

// Samples a visible half vector for the point u of the unit square (Dupuy and Benyoub 2023).
glm::dvec3 visible_half_vector(const glm::dvec3& o, double alpha, const glm::dvec2& u) {
  const glm::dvec3 stretched = glm::normalize(glm::dvec3(o.x * alpha, o.y * alpha, o.z));
  const double phi = 2 * std::numbers::pi * u.x;
  const double z = (1 - u.y) * (1 + stretched.z) - stretched.z;
  const double sine = std::sqrt(std::clamp(1 - z * z, 0.0, 1.0));
  const glm::dvec3 cap = glm::dvec3(sine * std::cos(phi), sine * std::sin(phi), z) + stretched;
  return glm::normalize(glm::dvec3(cap.x * alpha, cap.y * alpha, cap.z));
}

double smith_lambda(const glm::dvec3& w, double alpha) {
  const double tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
  return 0.5 * (std::sqrt(1 + alpha * alpha * tan2) - 1);
}

double dielectric_reflectance(double cosine, double eta) {
  const double sin2 = (1 - cosine * cosine) / (eta * eta);
  if (sin2 >= 1) return 1;
  const double behind = std::sqrt(1 - sin2);
  const double parallel = (eta * cosine - behind) / (eta * cosine + behind);
  const double perpendicular = (cosine - eta * behind) / (cosine + eta * behind);
  return 0.5 * (parallel * parallel + perpendicular * perpendicular);
}

// Returns the weight of a direction that was sampled by the visible normals: the light that passes
// the facets' shadowing over the light that passed their masking; 0 if the direction ends up on the
// wrong side.
double direction_weight(const glm::dvec3& o, const glm::dvec3& i, double side, double alpha) {
  if (i.z * side <= 0) return 0;
  const double masked = 1 + smith_lambda(o, alpha);
  return masked / (masked + smith_lambda(i, alpha));
}

// Returns the mean of `weight(o, half vector, alpha)` over the visible normals, at every node.
template <typename Weight>
AlbedoTable tabulate(const Weight& weight) {
  constexpr int points = 2048;
  constexpr double golden = 0.6180339887498949;  // the step of a Fibonacci lattice
  AlbedoTable table;
  for (std::uint32_t row = 0; row < gpu::ALBEDO_SIDE; ++row) {
    // Roughness 0 is a mirror; the least alpha and cosine keep its numbers finite.
    const double roughness = row / (gpu::ALBEDO_SIDE - 1.0);
    const double alpha = std::max(roughness * roughness, 1e-4);
    for (std::uint32_t column = 0; column < gpu::ALBEDO_SIDE; ++column) {
      const double root = column / (gpu::ALBEDO_SIDE - 1.0);
      const double cosine = std::max(root * root, 1e-4);
      const glm::dvec3 o(std::sqrt(1 - cosine * cosine), 0, cosine);
      double sum = 0;
      for (int k = 0; k < points; ++k) {
        const glm::dvec2 u(k * golden - std::floor(k * golden), (k + 0.5) / points);
        sum += weight(o, visible_half_vector(o, alpha, u), alpha);
      }
      table.push_back(static_cast<float>(sum / points));
    }
  }
  return table;
}

}  // namespace

const AlbedoTable& reflection_albedo() {
  static const AlbedoTable table =
      tabulate([](const glm::dvec3& o, const glm::dvec3& h, double alpha) {
        return direction_weight(o, 2 * glm::dot(o, h) * h - o, 1, alpha);
      });
  return table;
}

AlbedoTable refraction_albedo(double eta) {
  return tabulate([eta](const glm::dvec3& o, const glm::dvec3& h, double alpha) {
    const double cosine = glm::dot(o, h);
    const double reflectance = dielectric_reflectance(cosine, eta);
    const double reflected = direction_weight(o, 2 * cosine * h - o, 1, alpha);
    if (reflectance >= 1) return reflected;
    const double behind = std::sqrt(std::max(0.0, 1 - (1 - cosine * cosine) / (eta * eta)));
    const glm::dvec3 refracted = (cosine / eta - behind) * h - o / eta;
    return reflectance * reflected + (1 - reflectance) * direction_weight(o, refracted, -1, alpha);
  });
}

}  // namespace previz::render
