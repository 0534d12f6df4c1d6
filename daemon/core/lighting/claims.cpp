#include "daemon/core/lighting/claims.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <numeric>

#include "daemon/core/lighting/luminance.hpp"

namespace previz::lighting {
namespace {

constexpr int blur_texels = 2;  // as around a found source
constexpr int claim_ring_texels = 2;

// Returns whether a ray from the origin meets the triangle, by the signs of the volumes that it
// spans with the edges; either side counts.
bool meets(const glm::dvec3& ray, const glm::dvec3* corner) {
  const double u = glm::dot(ray, glm::cross(corner[0], corner[1]));
  const double v = glm::dot(ray, glm::cross(corner[1], corner[2]));
  const double w = glm::dot(ray, glm::cross(corner[2], corner[0]));
  const bool inside = (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
  const double volume = u + v + w;
  if (!inside || volume == 0) return false;
  // Barycentric coordinates give the point that is met; it must lie before the origin, not behind.
  return glm::dot(ray, v * corner[0] + w * corner[1] + u * corner[2]) / volume > 0;
}

double texel_width_rad(int size) {
  return std::sqrt(texel_sr(size));
}

// Grows the claim `label` by so many texels into texels of no claim.
void widen(std::uint32_t label, int texels, int size, std::vector<std::uint32_t>& labels) {
  std::vector<std::uint32_t> front;
  for (std::uint32_t t = 0; t < labels.size(); ++t)
    if (labels[t] == label) front.push_back(t);
  for (int i = 0; i < texels; ++i) front = grow(front, size, labels);
}

// The texels of a claim.
struct Covered {
  std::vector<std::uint32_t> texels;
  std::uint32_t middle = 0;  // the texel nearest to the claim's centre
  double cosine = -2;        // of the angle between them
};

std::vector<Covered> covered_by(const std::vector<Claim>& claims, int size,
                                const FromCamera& from_camera) {
  std::vector<Covered> covered(claims.size());
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i) {
      const auto direction = from_camera(glm::dvec3(texel_direction(size, i, j)));
      if (!direction) continue;
      const auto t = static_cast<std::uint32_t>(j * size + i);
      for (std::size_t c = 0; c < claims.size(); ++c) {
        const double cosine = glm::dot(*direction, claims[c].centre);
        if (cosine > covered[c].cosine) covered[c].cosine = cosine, covered[c].middle = t;
        if (claims[c].covers(*direction)) covered[c].texels.push_back(t);
      }
    }
  // A lamp smaller than a texel covers no texel's centre; it is in the nearest one, if that is
  // seen.
  const double at_most = std::max(outline_margin_rad, texel_width_rad(size));
  for (Covered& claim : covered)
    if (claim.texels.empty() && claim.cosine >= std::cos(at_most))
      claim.texels.push_back(claim.middle);
  return covered;
}

// Gives a region that others surround its ring in them; one that has the whole map to itself has no
// light that exceeds anything, and becomes empty.
void give_inner_ring(std::uint32_t label, const EnvironmentMap& map, BrightRegion& region) {
  std::vector<std::uint32_t> labels(map.radiance.size(), no_region);
  for (const std::uint32_t t : region.texels) labels[t] = label;
  std::vector<std::uint32_t> front = region.texels;
  glm::dvec3 sum(0);
  double count = 0;
  for (int i = 0; i < claim_ring_texels; ++i) {
    front = grow(front, map.size, labels);
    for (const std::uint32_t t : front) sum += glm::dvec3(map.radiance[t]);
    count += static_cast<double>(front.size());
  }
  if (count > 0)
    region.ring = sum / count;
  else
    region.texels.clear();
}

}  // namespace

bool Claim::covers(const glm::dvec3& direction) const {
  if (cone_rad > 0) return glm::dot(direction, centre) >= std::cos(cone_rad);
  for (std::size_t i = 0; i + 2 < outline.size(); i += 3)
    if (meets(direction, &outline[i])) return true;
  return false;
}

Claims::Claims(const std::vector<Claim>& claims, int size, const FromCamera& from_camera)
    : claims_(claims), from_camera_(from_camera), size_(size) {
  if (claims.empty()) return;
  labels_.assign(static_cast<std::size_t>(size) * static_cast<std::size_t>(size), no_region);
  const std::vector<Covered> covered = covered_by(claims, size, from_camera);
  std::vector<std::uint32_t> narrowest_first(claims.size());
  std::iota(narrowest_first.begin(), narrowest_first.end(), 0u);
  std::ranges::stable_sort(narrowest_first, {},
                           [&](std::uint32_t c) { return covered[c].texels.size(); });
  for (const std::uint32_t c : narrowest_first)
    for (const std::uint32_t t : covered[c].texels)
      if (labels_[t] == no_region) labels_[t] = c;
  const int margin = std::max(
      blur_texels, static_cast<int>(std::ceil(outline_margin_rad / texel_width_rad(size))));
  for (std::uint32_t c = 0; c < claims.size(); ++c)
    if (claims[c].cone_rad == 0) widen(c, margin, size, labels_);
}

// Returns the region of each claim in this map, with its ring.
std::vector<BrightRegion> Claims::regions(const EnvironmentMap& map,
                                          const set::LightSources& settings) const {
  std::vector<std::uint32_t> labels = labels_;
  const double least_flux = settings.least_share * luminance(glm::vec3(total_flux(map)));
  for (const BrightRegion& region : bright_regions(map, settings.contrast, least_flux)) {
    double all = 0;
    std::vector<double> of_claim(claims_.size());
    for (const std::uint32_t t : region.texels) {
      const double light = luminance(glm::max(glm::dvec3(map.radiance[t]) - region.ring, 0.0));
      all += light;
      if (labels_[t] != no_region) of_claim[labels_[t]] += light;
    }
    const double region_sr = static_cast<double>(region.texels.size()) * texel_sr(map.size);
    const auto belongs = [&](std::size_t claim) {
      const bool may_be_wider =
          !claims_[claim].has_size &&
          region_sr <= 4 * std::numbers::pi * std::pow(std::sin(widest_unstated_rad / 2), 2);
      return of_claim[claim] > (may_be_wider ? 0 : all / 2);
    };
    const auto most =
        static_cast<std::size_t>(std::ranges::max_element(of_claim) - of_claim.begin());
    if (!belongs(most)) continue;
    for (const std::uint32_t t : region.texels)
      if (labels[t] == no_region) labels[t] = static_cast<std::uint32_t>(most);
  }

  std::vector<BrightRegion> result(claims_.size());
  std::vector<std::uint32_t> front;
  for (std::uint32_t t = 0; t < labels.size(); ++t)
    if (labels[t] != no_region) {
      result[labels[t]].texels.push_back(t);
      front.push_back(t);
    }
  std::vector<std::size_t> in_ring(claims_.size());
  for (int i = 0; i < claim_ring_texels; ++i) {
    front = grow(front, map.size, labels);
    for (const std::uint32_t t : front) {
      result[labels[t]].ring += glm::dvec3(map.radiance[t]);
      ++in_ring[labels[t]];
    }
  }
  for (std::size_t c = 0; c < result.size(); ++c) {
    if (in_ring[c] > 0)
      result[c].ring /= static_cast<double>(in_ring[c]);
    else
      give_inner_ring(static_cast<std::uint32_t>(c), map, result[c]);
  }
  return result;
}

std::vector<Source> Claims::take_out(EnvironmentMap& map, const set::LightSources& settings) const {
  std::vector<Source> sources;
  if (empty() || map.size != size_) return sources;
  const std::vector<BrightRegion> all = regions(map, settings);
  for (std::size_t c = 0; c < all.size(); ++c) {
    for (Source& part : measure(all[c], map)) {
      part.claim = static_cast<int>(c);
      sources.push_back(part);
    }
  }
  for (const BrightRegion& region : all) fill(region, map);
  return sources;
}

void Claims::mark(std::vector<Source>& sources) const {
  for (Source& source : sources) {
    const auto direction = from_camera_ ? from_camera_(source.direction) : source.direction;
    if (!direction) continue;
    const auto covers = [&](const Claim& claim) {
      // A lamp's light can have its middle beside a narrow outline, or beside a lamp without a
      // size; half its width is allowed for.
      const bool may_be_beside = claim.cone_rad == 0 || !claim.has_size;
      return claim.covers(*direction) ||
             (may_be_beside && glm::dot(*direction, claim.centre) >=
                                   std::cos(outline_margin_rad + angular_radius(source)));
    };
    const auto claim = std::ranges::find_if(claims_, covers);
    if (claim != claims_.end()) source.claim = static_cast<int>(claim - claims_.begin());
  }
}

}  // namespace previz::lighting
