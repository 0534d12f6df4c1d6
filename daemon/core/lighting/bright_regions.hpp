// Finds the bright regions of an environment map: connected components above a threshold that
// follows the map, split where two separate lamps merely touch (P10).
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "daemon/core/lighting/environment.hpp"

namespace previz::lighting {

struct BrightRegion {
  std::vector<std::uint32_t> texels;  // of the map: the bright texels and their blurred edge
  glm::dvec3 ring{0};  // mean radiance of the texels around `texels`; 0: there are none
};

inline constexpr std::uint32_t no_region = 0xffffffffu;

// Gives the unlabelled neighbours (no_region) of `front` its labels, and returns them. `labels` has
// an entry for every texel of a map of this size.
std::vector<std::uint32_t> grow(const std::vector<std::uint32_t>& front, int size,
                                std::vector<std::uint32_t>& labels);

// Returns the luminance above which a texel is bright: `contrast` times the mean luminance of all
// texels that are not bright. It is the largest such value, found from above as Ridler and Calvard
// 1978 find theirs ("Picture Thresholding Using an Iterative Selection Method"): it does not depend
// on how bright the lamps are, and an overcast sky has nothing above it.
double bright_threshold(const EnvironmentMap& map, double contrast);

// Returns the regions. Bright texels that touch (8 neighbours, also over the edges of the
// octahedral square) form one region. Two touching peaks are two regions if each is at least twice
// as bright as the saddle between them, and brings at least `least_flux` of luminance (sr times
// luminance) on its own at that height: a watershed by dynamics (Grimaud 1992, "New measure of
// contrast: the dynamics"). Regions do not overlap; their order and contents depend on nothing but
// the map.
std::vector<BrightRegion> bright_regions(const EnvironmentMap& map, double contrast,
                                         double least_flux);

}  // namespace previz::lighting
