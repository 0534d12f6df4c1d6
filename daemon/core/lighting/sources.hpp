// Extracts the light sources of an environment map (P10), each a direction, a solid angle and a
// flux, and the map without them (shaders/README.md, "Light").
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "daemon/core/lighting/bright_regions.hpp"
#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::lighting {

double angular_radius(const Source& source);  // rad
glm::dvec3 radiance(const Source& source);

struct Extraction {
  std::vector<Source> sources;                      // sorted by falling flux
  std::vector<std::vector<std::uint32_t>> regions;  // texels of each Source::region
  // The map with each hole filled by the mean of the ring around it, or by the original radiance if
  // that is less: sources + residual = map, per channel.
  EnvironmentMap residual;
  int left = 0;  // bright regions that stay in the residual: too faint, too wide or too many
};

inline constexpr std::size_t most_sources = 32;      // every ray is tested against each
inline constexpr double widest_source_rad = 0.5236;  // 30 degrees; wider ones stay in the map

// Extracts the bright regions (bright_regions.hpp) that bring at least settings.least_share of the
// map's luminous flux. Half of that is enough for a region that contains a direction of `known`, so
// that a lamp at the limit does not flicker. Reflections of lamps mostly bring less and stay in the
// residual. A region more than twice as long as wide (a tube, a window) is cut across its length
// until its parts are not, so that its light still comes from all along it.
Extraction extract_sources(const EnvironmentMap& map, const set::LightSources& settings,
                           std::span<const Source> known = {});

// Returns what the region has above its ring, as one source or, where it is longer than a disc can
// stand for, several; none where it has nothing.
std::vector<Source> measure(const BrightRegion& region, const EnvironmentMap& map);
// Fills the region with its ring's mean, or with what is there if that is less.
void fill(const BrightRegion& region, EnvironmentMap& map);

// Returns the map at 16 texels a side (14 degrees) or less: the same flux, hardly any shape.
EnvironmentMap blurred(const EnvironmentMap& map);

}  // namespace previz::lighting
