#include "tests/truth/cpu_albedo.hpp"

#include <algorithm>
#include <cmath>
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

// Rows are made when first asked for; a material has few roughnesses, textured ones are rounded.
double remembered(double nv, double alpha, double eta) {
  static std::mutex mutex;
  static std::map<std::pair<double, double>, std::vector<double>> rows;
  const double rounded = std::max(std::round(alpha * 4096) / 4096, 1e-4);
  const std::scoped_lock lock(mutex);
  std::vector<double>& row = rows[{rounded, eta}];
  if (row.empty())
    for (int i = 0; i < nodes; ++i)
      row.push_back(share_at(std::max(std::cos(i * std::numbers::pi / 2 / (nodes - 1)), grazing),
                             rounded, eta));
  const double at = std::acos(std::clamp(nv, 0.0, 1.0)) * 2 / std::numbers::pi * (nodes - 1);
  const auto low = static_cast<std::size_t>(std::min(at, nodes - 1.001));
  const double f = at - static_cast<double>(low);
  return (1 - f) * row[low] + f * row[low + 1];
}

}  // namespace

double reflected_share(double nv, double alpha) {
  return remembered(nv, alpha, 0);
}

double scattered_share(double nv, double alpha, double eta) {
  return remembered(nv, alpha, eta);
}

}  // namespace previz::truth
