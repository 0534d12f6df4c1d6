#include "tests/truth/cpu_albedo.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <mutex>
#include <numbers>
#include <utility>
#include <vector>

#include "tests/truth/cpu_bsdf.hpp"

namespace previz::truth {
namespace {

constexpr int nodes = 128;  // over the angle to the normal
constexpr double grazing = 1e-3;

double smith_masked(double cosine, double alpha) {  // 1 + lambda
  const double tan2 = 1 / (cosine * cosine) - 1;
  return 0.5 * (1 + std::sqrt(1 + alpha * alpha * tan2));
}

// By the midpoint rule over slopes of the facets: tan = alpha tan(u), even where the lobe is.
// eta 0: reflection only, Fresnel term 1.
double share_at(double nv, double alpha, double eta) {
  constexpr int rings = 160, spokes = 64;
  const double pi = std::numbers::pi;
  const double across = std::sqrt(1 - nv * nv);
  double sum = 0, normalisation = 0;
  for (int ring = 0; ring < rings; ++ring) {
    const double u = (ring + 0.5) / rings * pi / 2;
    const double tangent = alpha * std::tan(u);
    const double hz = 1 / std::sqrt(1 + tangent * tangent);
    const double slope = tangent * hz;
    // D cos dw over this ring, up to a constant: 2 tan / (alpha^2 (1 + tan^2 / alpha^2)^2) dtan.
    const double facets = std::sin(u) * std::cos(u);
    for (int spoke = 0; spoke < spokes; ++spoke) {
      const double oh = nv * hz + across * slope * std::cos((spoke + 0.5) / spokes * pi);
      if (oh <= 0) continue;
      const double visible = facets * oh / hz;
      normalisation += visible;
      const double reflectance = eta > 0 ? fresnel_dielectric(std::min(oh, 1.0), eta) : 1;
      const double masked = smith_masked(nv, alpha);
      const double reflected_z = 2 * oh * hz - nv;
      if (reflected_z > 0)
        sum += visible * reflectance * masked / (masked + smith_masked(reflected_z, alpha) - 1);
      if (reflectance >= 1) continue;
      const double behind = std::sqrt(std::max(0.0, 1 - (1 - oh * oh) / (eta * eta)));
      const double refracted_z = (oh / eta - behind) * hz - nv / eta;
      if (refracted_z < 0)
        sum +=
            visible * (1 - reflectance) * masked / (masked + smith_masked(-refracted_z, alpha) - 1);
    }
  }
  return sum / normalisation;
}

// Interpolates values at angles to the normal.
double between_nodes(const std::vector<double>& row, double nv) {
  const double at = std::acos(std::clamp(nv, 0.0, 1.0)) * 2 / std::numbers::pi * (nodes - 1);
  const auto low = static_cast<std::size_t>(std::min(at, nodes - 1.001));
  const double f = at - static_cast<double>(low);
  return (1 - f) * row[low] + f * row[low + 1];
}

double node_cosine(int i) {
  return std::max(std::cos(i * std::numbers::pi / 2 / (nodes - 1)), grazing);
}

// Rows are made when first asked for; a material has few roughnesses, textured ones are rounded.
double remembered(double nv, double alpha, double eta) {
  static std::mutex mutex;
  static std::map<std::pair<double, double>, std::vector<double>> rows;
  const double rounded = std::max(std::round(alpha * 4096) / 4096, 1e-4);
  const std::scoped_lock lock(mutex);
  std::vector<double>& row = rows[{rounded, eta}];
  if (row.empty())
    for (int i = 0; i < nodes; ++i) row.push_back(share_at(node_cosine(i), rounded, eta));
  return between_nodes(row, nv);
}

double smith_root(const glm::dvec3& w, const glm::dvec2& alpha) {
  return glm::length(glm::dvec3(alpha.x * w.x, alpha.y * w.y, w.z));
}

glm::dvec3 local_direction(double cosine, double azimuth) {
  const double sine = std::sqrt(1 - cosine * cosine);
  return {sine * std::cos(azimuth), sine * std::sin(azimuth), cosine};
}

// Integrates by the midpoint rule over slopes, as share_at() does.
double anisotropic_share_at(const glm::dvec3& o, const glm::dvec2& alpha, int rings) {
  const int spokes = 2 * rings;
  const double masked = 0.5 * (1 + smith_root(o, alpha) / o.z);  // 1 + lambda
  double sum = 0, normalisation = 0;
  for (int ring = 0; ring < rings; ++ring) {
    const double u = (ring + 0.5) / rings * std::numbers::pi / 2;
    const double facets = std::sin(u) * std::cos(u);
    for (int spoke = 0; spoke < spokes; ++spoke) {
      const double psi = (spoke + 0.5) / spokes * 2 * std::numbers::pi;
      const glm::dvec3 slope(alpha.x * std::tan(u) * std::cos(psi),
                             alpha.y * std::tan(u) * std::sin(psi), 1);
      const glm::dvec3 h = glm::normalize(slope);
      const double oh = glm::dot(o, h);
      if (oh <= 0) continue;
      const double visible = facets * oh / h.z;
      normalisation += visible;
      const glm::dvec3 i = 2 * oh * h - o;
      if (i.z > 0) sum += visible * masked / (masked + 0.5 * (smith_root(i, alpha) / i.z - 1));
    }
  }
  return sum / normalisation;
}

// Over half vectors: the sine of their angle to the normal is t^(1 / (2 + 1/alpha)) where t is even
// over D cos dw. Midpoints are even over the root of 1 - t, which is about their cosine.
double sheen_share_at(double nv, double alpha) {
  constexpr int rings = 200, spokes = 64;
  const double power = 1 / (2 + 1 / alpha);
  const double across = std::sqrt(1 - nv * nv);
  double sum = 0;
  for (int ring = 0; ring < rings; ++ring) {
    const double root = (ring + 0.5) / rings;
    const double sine = std::pow(1 - root * root, power);
    const double hz = std::sqrt(1 - sine * sine);
    for (int spoke = 0; spoke < spokes; ++spoke) {
      const double oh =
          nv * hz + across * sine * std::cos((spoke + 0.5) / spokes * std::numbers::pi);
      const double iz = 2 * oh * hz - nv;
      if (iz <= 0) continue;
      sum += 2 * root * oh / hz / (1 + sheen_lambda(nv, alpha) + sheen_lambda(iz, alpha));
    }
  }
  return sum / (rings * spokes) / nv;
}

}  // namespace

double reflected_share(double nv, double alpha) {
  return remembered(nv, alpha, 0);
}

double scattered_share(double nv, double alpha, double eta) {
  return remembered(nv, alpha, eta);
}

double anisotropic_share(const glm::dvec3& o, const glm::dvec2& alpha) {
  return anisotropic_share_at(o, alpha, 160);
}

double anisotropic_share_kept(const glm::dvec3& o, const glm::dvec2& alpha) {
  constexpr int azimuths = 17;  // of a quarter turn
  static std::mutex mutex;
  static std::map<std::pair<double, double>, std::vector<std::vector<double>>> tables;
  const double quarter = std::numbers::pi / 2;
  const std::scoped_lock lock(mutex);
  auto& rows = tables[{alpha.x, alpha.y}];
  if (rows.empty()) {
    rows.resize(azimuths);
    for (int a = 0; a < azimuths; ++a)
      for (int i = 0; i < nodes; ++i)
        rows[static_cast<std::size_t>(a)].push_back(anisotropic_share_at(
            local_direction(node_cosine(i), a * quarter / (azimuths - 1)), alpha, 48));
  }
  const double at = std::atan2(std::abs(o.y), std::abs(o.x)) / quarter * (azimuths - 1);
  const auto low = static_cast<std::size_t>(std::min(at, azimuths - 1.001));
  const double f = at - static_cast<double>(low);
  return (1 - f) * between_nodes(rows[low], o.z) + f * between_nodes(rows[low + 1], o.z);
}

double sheen_share(double nv, double roughness) {
  static std::mutex mutex;
  static std::map<double, std::vector<double>> rows;
  const std::scoped_lock lock(mutex);
  std::vector<double>& row = rows[roughness];
  if (row.empty())
    for (int i = 0; i < nodes; ++i)  // even over the root of the cosine: it is steep near grazing
      row.push_back(
          sheen_share_at(std::max(std::pow(i / (nodes - 1.0), 2), grazing), roughness * roughness));
  const double at = std::sqrt(std::clamp(nv, 0.0, 1.0)) * (nodes - 1);
  const auto low = static_cast<std::size_t>(std::min(at, nodes - 1.001));
  const double f = at - static_cast<double>(low);
  return (1 - f) * row[low] + f * row[low + 1];
}

}  // namespace previz::truth
