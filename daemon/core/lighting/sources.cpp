#include "daemon/core/lighting/sources.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <numbers>
#include <utility>

#include "daemon/core/lighting/bright_regions.hpp"
#include "daemon/core/lighting/luminance.hpp"

namespace previz::lighting {
namespace {

using std::numbers::pi;

constexpr double longest_aspect = 2;  // of a region that one disc represents
constexpr int blurred_size = 16;

// The light of one texel above the ring's.
struct Glow {
  glm::dvec3 direction;
  glm::dvec3 excess;
  double weight() const { return luminance(excess); }
};
using Glows = std::vector<Glow>;

glm::dvec3 centre_of_gravity(const Glows& glows) {
  glm::dvec3 sum(0);
  for (const Glow& glow : glows) sum += glow.weight() * glow.direction;
  // Light from all around has no direction of its own; any direction is as good.
  return glm::length(sum) > 0 ? glm::normalize(sum) : glm::dvec3(0, 0, 1);
}

// Returns the luminance such that half of the light comes from texels at least as bright. That is a
// lamp's own luminance, however a lens blurs its edge: the edge has the lesser part of the light.
double median_by_light(const Glows& glows) {
  std::vector<double> weights;
  double rest = 0;
  for (const Glow& glow : glows) rest += weights.emplace_back(glow.weight()) / 2;
  std::ranges::sort(weights, std::greater{});
  for (const double weight : weights)
    if ((rest -= weight) <= 0) return weight;
  return 0;
}

Source measured(const Glows& glows, double sr) {
  Source source;
  source.direction = centre_of_gravity(glows);
  for (const Glow& glow : glows) source.flux += sr * glow.excess;
  const double median = median_by_light(glows);
  source.solid_angle_sr = median > 0 ? luminance(source.flux) / median : 0;
  return source;
}

// The shape of a light distribution over directions: how much longer than wide it is, and along
// which direction.
struct Shape {
  double aspect = 1;
  glm::dvec3 along{1, 0, 0};
};

Shape shape_of(const Glows& glows, const glm::dvec3& centre, double sr) {
  const glm::dvec3 helper = std::abs(centre.z) < 0.9 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
  const glm::dvec3 u = glm::normalize(glm::cross(helper, centre)), v = glm::cross(centre, u);
  double uu = 0, uv = 0, vv = 0, sum = 0;
  for (const Glow& glow : glows) {
    const glm::dvec2 at(glm::dot(glow.direction, u), glm::dot(glow.direction, v));
    uu += glow.weight() * at.x * at.x;
    uv += glow.weight() * at.x * at.y;
    vv += glow.weight() * at.y * at.y;
    sum += glow.weight();
  }
  if (!(sum > 0)) return {};
  // The shape follows from the eigenvalues of the covariance; a texel has a width of its own, sr /
  // 12 of variance.
  const double middle = 0.5 * (uu + vv), spread = std::hypot(0.5 * (uu - vv), uv);
  const double least = std::max(middle - spread, 0.0) / sum + sr / 12;
  const double most = (middle + spread) / sum + sr / 12;
  const double angle = 0.5 * std::atan2(2 * uv, uu - vv);
  return {std::sqrt(most / least), std::cos(angle) * u + std::sin(angle) * v};
}

// Appends the source of these texels, or the sources of their halves if they are too long for one
// source.
void measure_parts(const Glows& glows, double sr, std::vector<Source>& sources) {
  const Source whole = measured(glows, sr);
  const Shape shape = shape_of(glows, whole.direction, sr);
  if (shape.aspect > longest_aspect) {
    Glows halves[2];
    for (const Glow& glow : glows)
      halves[glm::dot(glow.direction - whole.direction, shape.along) > 0].push_back(glow);
    if (!halves[0].empty() && !halves[1].empty()) {
      for (const Glows& half : halves) measure_parts(half, sr, sources);
      return;
    }
  }
  if (whole.solid_angle_sr > 0) sources.push_back(whole);
}

struct Candidate {
  BrightRegion region;
  std::vector<Source> parts;
  double flux = 0;  // luminous
  bool known = false;
};

Glows glows_of(const BrightRegion& region, const EnvironmentMap& map) {
  Glows glows;
  for (const std::uint32_t t : region.texels) {
    const int i = static_cast<int>(t) % map.size, j = static_cast<int>(t) / map.size;
    const glm::dvec3 excess = glm::max(glm::dvec3(map.radiance[t]) - region.ring, 0.0);
    glows.push_back({glm::dvec3(texel_direction(map.size, i, j)), excess});
  }
  return glows;
}

Candidate measured(BrightRegion region, const EnvironmentMap& map, std::span<const Source> known) {
  Candidate candidate;
  const Glows glows = glows_of(region, map);
  const double sr = texel_sr(map.size);
  for (const Glow& glow : glows) candidate.flux += sr * glow.weight();
  candidate.known = std::ranges::any_of(known, [&](const Source& source) {
    const auto texel = texel_index(map.size, glm::vec3(source.direction));
    return std::ranges::find(region.texels, texel) != region.texels.end();
  });
  measure_parts(glows, sr, candidate.parts);
  candidate.region = std::move(region);
  return candidate;
}

bool too_wide(const Candidate& candidate) {
  return std::ranges::any_of(
      candidate.parts, [](const Source& part) { return angular_radius(part) > widest_source_rad; });
}

}  // namespace

double angular_radius(const Source& source) {
  // 2 pi (1 - cos r) = 4 pi sin^2(r / 2)
  return 2 * std::asin(std::sqrt(std::min(source.solid_angle_sr / (4 * pi), 1.0)));
}

glm::dvec3 radiance(const Source& source) {
  return source.flux / source.solid_angle_sr;
}

Extraction extract_sources(const EnvironmentMap& map, const set::LightSources& settings,
                           std::span<const Source> known) {
  Extraction extraction;
  extraction.residual = map;
  const double least_flux = settings.least_share * luminance(glm::vec3(total_flux(map)));

  std::vector<Candidate> candidates;
  for (BrightRegion& region : bright_regions(map, settings.contrast, least_flux))
    candidates.push_back(measured(std::move(region), map, known));
  std::ranges::stable_sort(candidates, std::greater{}, &Candidate::flux);
  for (const Candidate& candidate : candidates) {
    const double least = candidate.known ? least_flux / 2 : least_flux;
    const std::size_t with_it = extraction.sources.size() + candidate.parts.size();
    if (candidate.parts.empty() || candidate.flux < least || too_wide(candidate) ||
        with_it > most_sources) {
      ++extraction.left;
      continue;
    }
    for (const Source& part : candidate.parts) {
      extraction.sources.push_back(part);
      extraction.sources.back().region = static_cast<int>(extraction.regions.size());
    }
    extraction.regions.push_back(candidate.region.texels);
    fill(candidate.region, extraction.residual);
  }
  std::ranges::stable_sort(extraction.sources, std::greater{},
                           [](const Source& source) { return luminance(glm::vec3(source.flux)); });
  return extraction;
}

std::vector<Source> measure(const BrightRegion& region, const EnvironmentMap& map) {
  std::vector<Source> parts;
  measure_parts(glows_of(region, map), texel_sr(map.size), parts);
  return parts;
}

void fill(const BrightRegion& region, EnvironmentMap& map) {
  for (const std::uint32_t t : region.texels)
    map.radiance[t] = glm::min(map.radiance[t], glm::vec3(region.ring));
}

EnvironmentMap blurred(const EnvironmentMap& map) {
  if (map.size <= blurred_size) return map;
  const int part = map.size / blurred_size;
  std::vector<glm::dvec3> sums(std::size_t{blurred_size} * blurred_size);
  for (int j = 0; j < map.size; ++j)
    for (int i = 0; i < map.size; ++i)
      sums[static_cast<std::size_t>(j / part * blurred_size + i / part)] +=
          glm::dvec3(map.radiance[static_cast<std::size_t>(j) * map.size + i]);
  EnvironmentMap result{blurred_size, {}};
  for (const glm::dvec3& sum : sums) result.radiance.emplace_back(sum / (1.0 * part * part));
  return result;
}

}  // namespace previz::lighting
