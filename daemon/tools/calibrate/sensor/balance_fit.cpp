#include "daemon/tools/calibrate/sensor/balance_fit.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "daemon/core/lighting/luminance.hpp"
#include "daemon/tools/calibrate/sensor/paper.hpp"
#include "drivers/error.hpp"
#include "drivers/median.hpp"

namespace previz::calibrate {
namespace {

constexpr double median_over_mean = 1.2533;  // of standard errors (Gaussian): sqrt(pi / 2)
constexpr double sigma_over_mad = 1.4826;
// What is known of a surface's albedo before anything is measured: colours that were chosen with
// care are rarely off by more than a tenth. Without it, the surface with the most even light would
// decide alone.
constexpr double albedo_sigma = 0.1;

struct Location {
  double middle = 0, sigma = 0;
};

// Locates values that may have outliers. One value says nothing about its deviation; two give half
// their distance.
Location location(const std::vector<double>& values, double least_sigma) {
  Location at{median(values), least_sigma};
  if (values.size() < 2) return at;
  std::vector<double> off;
  for (const double value : values) off.push_back(std::abs(value - at.middle));
  const double n = double(values.size());
  const double sigma = median_over_mean * sigma_over_mad * median(off) / std::sqrt(n);
  // The deviation of few values is itself uncertain by 1 / sqrt(2 (n - 1)).
  at.sigma = std::max(least_sigma, sigma * (1 + 1 / std::sqrt(2 * (n - 1))));
  return at;
}

using Logs = std::vector<double>;

// A value with a weight.
struct Weighted {
  double value = 0, weight = 1;
};

// Returns the median of weighted values, interpolated between the middles of their weights: of
// equal weights it is median(), and of two values their weighted mean.
double weighted_median(std::vector<Weighted> values) {
  std::ranges::sort(values, {}, &Weighted::value);
  double sum = 0;
  for (const Weighted& one : values) sum += one.weight;
  double before = 0, last_middle = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const double middle = (before + 0.5 * values[i].weight) / sum;
    if (middle >= 0.5) {
      if (i == 0) return values[i].value;
      const double share = (0.5 - last_middle) / (middle - last_middle);
      return values[i - 1].value + share * (values[i].value - values[i - 1].value);
    }
    before += values[i].weight;
    last_middle = middle;
  }
  return values.back().value;
}

// Locates values of which each has its own deviation, as location() does for values alike. The
// number that counts is the sum of the weights over the largest: values that nobody can rely on
// make the others neither more certain nor less.
Location weighted_location(const std::vector<Weighted>& values, double least_sigma) {
  Location at{weighted_median(values), least_sigma};
  if (values.size() < 2) return at;
  std::vector<Weighted> off;
  double sum = 0, largest = 0;
  for (const Weighted& one : values) {
    off.push_back({std::abs(one.value - at.middle), one.weight});
    sum += one.weight;
    largest = std::max(largest, one.weight);
  }
  const double sigma =
      median_over_mean * sigma_over_mad * weighted_median(off) / std::sqrt(sum / largest);
  const double few = 1 / std::sqrt(2 * (double(values.size()) - 1));
  at.sigma = std::max(least_sigma, sigma * (1 + few));
  return at;
}

// Returns the medians of log(plate / rendered) of a channel, by tile.
Logs tile_medians(const SurfacePixels& seen, std::uint32_t surface, int channel) {
  std::map<std::uint32_t, Logs> by_tile;
  for (const SurfacePixel& pixel : seen.pixels)
    if (pixel.surface == surface && pixel.rendered[channel] > 0 && pixel.plate[channel] > 0)
      by_tile[pixel.tile].push_back(std::log(pixel.plate[channel] / pixel.rendered[channel]));
  Logs medians;
  for (auto& [tile, logs] : by_tile)
    if (logs.size() >= seen.surfaces[surface].least_pixels)
      medians.push_back(median(std::move(logs)));
  return medians;
}

std::vector<SurfaceRatio> ratios(const SurfacePixels& seen) {
  std::vector<SurfaceRatio> all;
  for (std::uint32_t s = 0; s < seen.surfaces.size(); ++s) {
    SurfaceRatio surface;
    surface.surface = s;
    surface.pixels = std::size_t(std::ranges::count(seen.pixels, s, &SurfacePixel::surface));
    bool all_channels = true;
    for (int c = 0; c < 3; ++c) {
      const Logs logs = tile_medians(seen, s, c);
      all_channels = all_channels && !logs.empty();
      if (logs.empty()) continue;
      // With one tile, the deviation is the step of an 8-bit code in the middle of its range, 2 %.
      const Location at = location(logs, logs.size() == 1 ? 0.02 : 0);
      surface.tiles = logs.size();
      surface.ratio[c] = std::exp(at.middle);
      surface.sigma[c] = at.sigma;
    }
    if (all_channels) all.push_back(surface);
  }
  return all;
}

std::string listed(const SurfacePixels& seen, const std::vector<SurfaceRatio>& surfaces) {
  std::string names;
  for (const SurfaceRatio& surface : surfaces)
    add_to_list(names, seen.surfaces[surface.surface].material);
  return names.empty() ? "none" : names;
}

void mark_references(const SurfacePixels& seen, const std::vector<std::string>& references,
                     std::vector<SurfaceRatio>& surfaces) {
  const auto is_paper = [&](const SurfaceRatio& surface) {
    return seen.surfaces[surface.surface].material == paper_name;
  };
  const bool has_paper = std::ranges::any_of(surfaces, is_paper);
  for (SurfaceRatio& surface : surfaces)
    surface.reference = references.empty() && (!has_paper || is_paper(surface));
  for (const std::string& name : references) {
    const auto found = std::ranges::find_if(surfaces, [&](const SurfaceRatio& surface) {
      return seen.surfaces[surface.surface].material == name;
    });
    if (found == surfaces.end())
      throw Error("reference surface \"" + name +
                  "\" is not visible enough; visible: " + listed(seen, surfaces));
    found->reference = true;
  }
}

}  // namespace

Balance fit_balance(const SurfacePixels& seen, const std::vector<std::string>& references) {
  Balance balance;
  balance.surfaces = ratios(seen);
  if (balance.surfaces.empty())
    throw Error("no diffuse real surface covers " + std::to_string(KnownSurface{}.least_pixels) +
                " unclipped pixels in any 1/16 of the picture: does the set have a phantom, "
                "and is it in the picture?");
  mark_references(seen, references, balance.surfaces);
  for (int c = 0; c < 3; ++c) {
    std::vector<Weighted> logs;
    double least_sigma = HUGE_VAL;
    for (const SurfaceRatio& surface : balance.surfaces) {
      if (!surface.reference) continue;
      const double variance = surface.sigma[c] * surface.sigma[c] + albedo_sigma * albedo_sigma;
      logs.push_back({std::log(surface.ratio[c]), 1 / variance});
      least_sigma = std::min(least_sigma, surface.sigma[c]);
    }
    const Location at = weighted_location(logs, least_sigma);
    balance.scale[c] = std::exp(at.middle);
    balance.sigma[c] = at.sigma;
  }
  return balance;
}

double exposure_error_stops(const Balance& balance) {
  return std::log2(lighting::luminance(glm::vec3(balance.scale)));
}

double exposure_error_sigma_stops(const Balance& balance) {
  return std::max({balance.sigma.r, balance.sigma.g, balance.sigma.b}) / std::log(2.0);
}

AlbedoEstimate albedo_of(const SurfaceRatio& surface, const KnownSurface& known,
                         const Balance& balance) {
  AlbedoEstimate estimate;
  estimate.albedo = known.albedo * surface.ratio / balance.scale;
  for (int c = 0; c < 3; ++c)
    estimate.sigma[c] = estimate.albedo[c] * std::hypot(surface.sigma[c], balance.sigma[c]);
  return estimate;
}

}  // namespace previz::calibrate
