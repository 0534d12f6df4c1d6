#include "daemon/core/render/world/albedo_table.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <numbers>

#include "shaders/lib/render_shared.h"

namespace previz::render {
namespace {

constexpr double last_node = gpu::ALBEDO_SIDE - 1.0;
constexpr double grazing_cosine = 1e-4;  // which, like the least alpha, keeps numbers finite

// Samples a visible half vector for the point u of the unit square (Dupuy and Benyoub 2023).
glm::dvec3 visible_half_vector(const glm::dvec3& o, const glm::dvec2& alpha, const glm::dvec2& u) {
  const glm::dvec3 stretched = glm::normalize(glm::dvec3(o.x * alpha.x, o.y * alpha.y, o.z));
  const double phi = 2 * std::numbers::pi * u.x;
  const double z = (1 - u.y) * (1 + stretched.z) - stretched.z;
  const double sine = std::sqrt(std::clamp(1 - z * z, 0.0, 1.0));
  const glm::dvec3 cap = glm::dvec3(sine * std::cos(phi), sine * std::sin(phi), z) + stretched;
  return glm::normalize(glm::dvec3(cap.x * alpha.x, cap.y * alpha.y, cap.z));
}

// Returns the point k of a Fibonacci lattice.
glm::dvec2 lattice_point(int k, int points) {
  constexpr double golden = 0.6180339887498949;
  return {k * golden - std::floor(k * golden), (k + 0.5) / points};
}

double smith_lambda(const glm::dvec3& w, double alpha) {
  const double tan2 = (w.x * w.x + w.y * w.y) / (w.z * w.z);
  return 0.5 * (std::sqrt(1 + alpha * alpha * tan2) - 1);
}
double smith_lambda(const glm::dvec3& w, const glm::dvec2& alpha) {
  const glm::dvec2 slope(alpha.x * w.x / w.z, alpha.y * w.y / w.z);
  return 0.5 * (std::sqrt(1 + glm::dot(slope, slope)) - 1);
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
template <typename Alpha>
double direction_weight(const glm::dvec3& o, const glm::dvec3& i, double side, const Alpha& alpha) {
  if (i.z * side <= 0) return 0;
  const double masked = 1 + smith_lambda(o, alpha);
  return masked / (masked + smith_lambda(i, alpha));
}

// Returns the mean of `weight(o, half vector, alpha)` over the visible normals, at every node.
template <typename Weight>
AlbedoTable tabulate(const Weight& weight) {
  constexpr int points = 2048;
  AlbedoTable table;
  for (std::uint32_t row = 0; row < gpu::ALBEDO_SIDE; ++row) {
    const double roughness = row / last_node;  // 0 is a mirror
    const double alpha = std::max(roughness * roughness, 1e-4);
    for (std::uint32_t column = 0; column < gpu::ALBEDO_SIDE; ++column) {
      const double root = column / last_node;
      const double cosine = std::max(root * root, grazing_cosine);
      const glm::dvec3 o(std::sqrt(1 - cosine * cosine), 0, cosine);
      double sum = 0;
      for (int k = 0; k < points; ++k)
        sum +=
            weight(o, visible_half_vector(o, glm::dvec2(alpha), lattice_point(k, points)), alpha);
      table.push_back(static_cast<float>(sum / points));
    }
  }
  return table;
}

double anisotropic_share(const glm::dvec3& o, const glm::dvec2& alpha) {
  constexpr int points = 1024;
  double sum = 0;
  for (int k = 0; k < points; ++k) {
    const glm::dvec3 h = visible_half_vector(o, alpha, lattice_point(k, points));
    sum += direction_weight(o, 2 * glm::dot(o, h) * h - o, 1, alpha);
  }
  return sum / points;
}

// Sheen's lambda (Conty Estevez and Kulla 2017, equation 3 and table 1).
double sheen_lambda(double cosine, double alpha) {
  const double smoothness = (1 - alpha) * (1 - alpha);
  const auto fitted = [&](double rough, double smooth) {
    return std::lerp(rough, smooth, smoothness);
  };
  const double a = fitted(21.5473, 25.3245), b = fitted(3.82987, 3.32435);
  const double c = fitted(0.19823, 0.16801), d = fitted(-1.97760, -1.27393);
  const double e = fitted(-4.32054, -4.85967);
  const auto logarithm = [&](double x) { return a / (1 + b * std::pow(x, c)) + d * x + e; };
  return std::exp(cosine < 0.5 ? logarithm(cosine) : 2 * logarithm(0.5) - logarithm(1 - cosine));
}

// Integrates D V cos by the midpoint rule over the azimuth and the root of the cosine of the other
// direction.
double sheen_share(double cosine, double roughness) {
  constexpr int rings = 64, spokes = 32;
  const double alpha = roughness * roughness;
  const double masked = 1 + sheen_lambda(cosine, alpha);
  const double sine = std::sqrt(1 - cosine * cosine);
  double sum = 0;
  for (int ring = 0; ring < rings; ++ring) {
    const double root = (ring + 0.5) / rings, cos_i = root * root;
    const double sin_i = std::sqrt(1 - cos_i * cos_i);
    double density = 0;
    for (int spoke = 0; spoke < spokes; ++spoke) {
      const double azimuth = (spoke + 0.5) / spokes * std::numbers::pi;
      const glm::dvec3 h = glm::normalize(
          glm::dvec3(sine + sin_i * std::cos(azimuth), sin_i * std::sin(azimuth), cosine + cos_i));
      density += std::pow(h.x * h.x + h.y * h.y, 0.5 / alpha) / spokes;
    }
    sum += 2 * root / rings * density / (masked + sheen_lambda(cos_i, alpha));
  }
  return (2 + 1 / alpha) * sum / (4 * cosine);
}

}  // namespace

const AlbedoTable& reflection_albedo() {
  static const AlbedoTable table =
      tabulate([](const glm::dvec3& o, const glm::dvec3& h, double alpha) {
        return direction_weight(o, 2 * glm::dot(o, h) * h - o, 1, alpha);
      });
  return table;
}

AlbedoTable anisotropic_albedo(double strength, double least, double most) {
  const auto row_of = [](double roughness) {
    return std::max(roughness, std::sqrt(double{gpu::LEAST_ANISOTROPIC_ALPHA})) * last_node;
  };
  const double first = std::floor(row_of(least) - 1e-3), end = std::ceil(row_of(most) + 1e-3);
  AlbedoTable tables;
  for (std::uint32_t table = 0; table < gpu::ANISOTROPIC_TABLES; ++table) {
    const double root = table / (gpu::ANISOTROPIC_TABLES - 1.0);
    const double along = root * root, across = std::sqrt(1 - along * along);
    for (std::uint32_t row = 0; row < gpu::ALBEDO_SIDE; ++row) {
      const double plain = std::pow(row / last_node, 2);
      const double narrow = std::max<double>(plain, gpu::LEAST_ANISOTROPIC_ALPHA);
      const glm::dvec2 alpha(std::max(std::lerp(plain, 1.0, strength * strength), narrow), narrow);
      for (std::uint32_t column = 0; column < gpu::ALBEDO_SIDE; ++column) {
        const double cosine = std::max(std::pow(column / last_node, 2), grazing_cosine);
        const double sine = std::sqrt(1 - cosine * cosine);
        const bool is_needed = row >= first && row <= end;
        tables.push_back(is_needed ? static_cast<float>(anisotropic_share(
                                         {sine * along, sine * across, cosine}, alpha))
                                   : 1.0f);
      }
    }
  }
  return tables;
}

const AlbedoTable& sheen_albedo() {
  static const AlbedoTable table = [] {
    constexpr double least = gpu::LEAST_SHEEN_ROUGHNESS;
    AlbedoTable result;
    for (std::uint32_t row = 0; row < gpu::ALBEDO_SIDE; ++row)
      for (std::uint32_t column = 0; column < gpu::ALBEDO_SIDE; ++column)
        result.push_back(static_cast<float>(
            sheen_share(std::max(std::pow(column / last_node, 2), grazing_cosine),
                        std::lerp(least, 1.0, std::pow(row / last_node, 2)))));
    return result;
  }();
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
