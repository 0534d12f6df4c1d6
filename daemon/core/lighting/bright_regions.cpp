#include "daemon/core/lighting/bright_regions.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "daemon/core/lighting/luminance.hpp"

namespace previz::lighting {
namespace {

// Peaks that rise over their saddle by less than this factor are one lamp with an uneven surface.
constexpr double least_dynamics = 2;

// A lens spreads the edge of a lamp over a pixel or two; texels are about a pixel or less.
constexpr int edge_texels = 2;
constexpr int ring_texels = 2;

std::array<std::uint32_t, 8> neighbours(int size, std::uint32_t texel) {
  const int i = static_cast<int>(texel) % size, j = static_cast<int>(texel) / size;
  std::array<std::uint32_t, 8> result{};
  std::size_t at = 0;
  for (int dj = -1; dj <= 1; ++dj)
    for (int di = -1; di <= 1; ++di)
      if (di != 0 || dj != 0)
        result[at++] = static_cast<std::uint32_t>(wrapped_texel(size, i + di, j + dj));
  return result;
}

// Grows peaks as texels are added from the brightest down, and decides whether two peaks that meet
// become one.
class Watershed {
 public:
  Watershed(const EnvironmentMap& map, double least_flux)
      : map_(map), least_flux_(least_flux), region_(map.radiance.size(), no_region) {}

  // Texels must be added in order of falling luminance.
  void add(std::uint32_t texel) {
    const double height = luminance(map_.radiance[texel]);
    std::uint32_t home = no_region;
    for (const std::uint32_t next : neighbours(map_.size, texel)) {
      if (region_[next] == no_region) continue;
      const std::uint32_t other = root(region_[next]);
      if (home == no_region)
        home = other;
      else if (other != home)
        home = meet(home, other, height);
    }
    if (home == no_region) {
      home = static_cast<std::uint32_t>(peaks_.size());
      peaks_.push_back({home, height, 0});
    }
    region_[texel] = home;
    peaks_[home].flux += height * texel_sr(map_.size);
  }

  // Returns the number of every texel's region, counted from the brightest peak.
  std::vector<std::uint32_t> labels(std::uint32_t& count) {
    std::vector<std::uint32_t> number(peaks_.size(), no_region);
    count = 0;
    for (std::uint32_t peak = 0; peak < peaks_.size(); ++peak)
      if (peaks_[peak].parent == peak) number[peak] = count++;
    std::vector<std::uint32_t> result(region_.size(), no_region);
    for (std::size_t t = 0; t < region_.size(); ++t)
      if (region_[t] != no_region) result[t] = number[root(region_[t])];
    return result;
  }

 private:
  struct Peak {
    std::uint32_t parent;
    double height, flux;
  };

  std::uint32_t root(std::uint32_t peak) {
    while (peaks_[peak].parent != peak)
      peak = peaks_[peak].parent = peaks_[peaks_[peak].parent].parent;
    return peak;
  }

  // Handles a saddle where two regions touch: they become one, or the texel between them goes to
  // the brighter one. Peaks are numbered from the brightest down.
  std::uint32_t meet(std::uint32_t a, std::uint32_t b, double saddle) {
    Peak &brighter = peaks_[std::min(a, b)], &fainter = peaks_[std::max(a, b)];
    const bool parted = fainter.height >= least_dynamics * saddle &&
                        std::min(brighter.flux, fainter.flux) >= least_flux_;
    if (!parted) {
      brighter.flux += fainter.flux;
      fainter.parent = brighter.parent;
    }
    return std::min(a, b);
  }

  const EnvironmentMap& map_;
  const double least_flux_;
  std::vector<std::uint32_t> region_;
  std::vector<Peak> peaks_;
};

std::vector<std::uint32_t> bright_texels(const EnvironmentMap& map, double threshold) {
  std::vector<std::uint32_t> bright;
  for (std::uint32_t t = 0; t < map.radiance.size(); ++t)
    if (luminance(map.radiance[t]) > threshold) bright.push_back(t);
  std::ranges::stable_sort(bright, std::greater{},
                           [&](std::uint32_t t) { return luminance(map.radiance[t]); });
  return bright;
}

}  // namespace

std::vector<std::uint32_t> grow(const std::vector<std::uint32_t>& front, int size,
                                std::vector<std::uint32_t>& labels) {
  std::vector<std::uint32_t> next;
  for (const std::uint32_t texel : front)
    for (const std::uint32_t neighbour : neighbours(size, texel))
      if (labels[neighbour] == no_region) {
        labels[neighbour] = labels[texel];
        next.push_back(neighbour);
      }
  return next;
}

double bright_threshold(const EnvironmentMap& map, double contrast) {
  std::vector<double> dark;
  dark.reserve(map.radiance.size());
  double sum = 0;
  for (const glm::vec3& radiance : map.radiance) sum += dark.emplace_back(luminance(radiance));
  // Every round removes the texels above the threshold from the mean, until there are none.
  for (;;) {
    const double threshold = dark.empty() ? 0 : contrast * sum / static_cast<double>(dark.size());
    const std::size_t before = dark.size();
    std::erase_if(dark, [=](double value) { return value > threshold; });
    if (dark.size() == before) return threshold;
    sum = 0;
    for (const double value : dark) sum += value;
  }
}

std::vector<BrightRegion> bright_regions(const EnvironmentMap& map, double contrast,
                                         double least_flux) {
  std::vector<std::uint32_t> front = bright_texels(map, bright_threshold(map, contrast));
  Watershed watershed(map, least_flux);
  for (const std::uint32_t texel : front) watershed.add(texel);
  std::uint32_t count = 0;
  std::vector<std::uint32_t> labels = watershed.labels(count);

  std::vector<BrightRegion> regions(count);
  const auto take = [&](const std::vector<std::uint32_t>& texels) {
    for (const std::uint32_t texel : texels) regions[labels[texel]].texels.push_back(texel);
  };
  take(front);
  for (int i = 0; i < edge_texels; ++i) take(front = grow(front, map.size, labels));
  std::vector<std::size_t> in_ring(count);
  for (int i = 0; i < ring_texels; ++i) {
    front = grow(front, map.size, labels);
    for (const std::uint32_t texel : front) {
      regions[labels[texel]].ring += glm::dvec3(map.radiance[texel]);
      ++in_ring[labels[texel]];
    }
  }
  for (std::uint32_t r = 0; r < count; ++r)
    if (in_ring[r] > 0) regions[r].ring /= static_cast<double>(in_ring[r]);
  return regions;
}

}  // namespace previz::lighting
