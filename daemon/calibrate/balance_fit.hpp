// One scale a channel between the two cameras, and the colours of surfaces, from pixels that show
// them: robust, with its uncertainty.
#pragma once

#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "daemon/calibrate/surface_pixels.hpp"

namespace previz::calibrate {

struct SurfaceRatio {
  std::uint32_t surface = 0;  // index into SurfacePixels::surfaces
  std::size_t pixels = 0;
  std::size_t tiles = 0;  // that have at least 8 of them
  glm::dvec3 ratio{1};    // plate over rendered: balance times true albedo over assumed
  glm::dvec3 sigma{0};    // standard deviation of its logarithm
  bool reference = false;
};

struct Balance {
  glm::dvec3 scale{1};  // what the light camera's radiance is multiplied by
  glm::dvec3 sigma{0};  // standard deviation of its logarithm
  std::vector<SurfaceRatio> surfaces;
  std::vector<std::string> notes;
};

// A surface's ratio is the median over tiles of the median over the tile's pixels of
// log(plate / rendered); its deviation that of a median (1.2533 times the mean's) over tiles, from
// their median absolute deviation. The balance is the median over the reference surfaces (all,
// where `references` is empty: as many albedos too low as too high), so that one wrong albedo among
// three does no harm; its deviation likewise, and never below that of one surface alone. Throws
// previz::Error if no surface can be used or a reference is not among those seen, naming those that
// are.
Balance fit_balance(const SurfacePixels& seen, const std::vector<std::string>& references);

// How far apart the exposures that the two cameras state are from what is seen, in stops of
// luminance; above 0: the light camera stated too much exposure (its light comes out too dark).
double exposure_error_stops(const Balance& balance);
double exposure_error_sigma_stops(const Balance& balance);

// The albedo that the plate shows under the balanced light; first order in the light that surfaces
// throw on each other. `sigma` is of the albedo.
struct AlbedoEstimate {
  glm::dvec3 albedo{0};
  glm::dvec3 sigma{0};
};
AlbedoEstimate albedo_of(const SurfaceRatio& surface, const KnownSurface& known,
                         const Balance& balance);

}  // namespace previz::calibrate
