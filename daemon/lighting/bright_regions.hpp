// Bright regions of an environment map: connected components above a threshold that follows the
// map, parted where two lamps have only run together (P10).
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "daemon/lighting/environment.hpp"

namespace previz::lighting {

struct BrightRegion {
  std::vector<std::uint32_t> texels;  // of the map: what is bright, and its blurred edge
  glm::dvec3 ring{0};                 // mean radiance of the texels around those; 0: there are none
};

// Luminance above which a texel is bright: `contrast` times the mean luminance of all texels that
// are not. The largest such value, found from above as Ridler and Calvard 1978 find theirs
// ("Picture Thresholding Using an Iterative Selection Method"): it does not depend on how bright
// the lamps are, and an overcast sky has nothing above it.
double bright_threshold(const EnvironmentMap& map, double contrast);

// Texels that are bright and touch (8 neighbours, over the edges of the octahedral square too) are
// a region. Where two peaks touch, they are two regions if each is at least twice as bright as the
// saddle between them, and brings `least_flux` of luminance by itself at that height (sr times
// luminance): a watershed by dynamics (Grimaud 1992, "New measure of contrast: the dynamics").
// Regions do not overlap; order and contents do not depend on anything but the map.
std::vector<BrightRegion> bright_regions(const EnvironmentMap& map, double contrast,
                                         double least_flux);

}  // namespace previz::lighting
