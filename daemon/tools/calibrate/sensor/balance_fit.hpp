// Fits one scale per channel between the two cameras, and the colours of surfaces, to pixels that
// show those surfaces: robustly, with uncertainties.
#pragma once

#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "daemon/tools/calibrate/sensor/surface_pixels.hpp"

namespace previz::calibrate {

struct SurfaceRatio {
  std::uint32_t surface = 0;  // index into SurfacePixels::surfaces
  std::size_t pixels = 0;
  std::size_t tiles = 0;  // tiles with enough of the pixels
  glm::dvec3 ratio{1};    // plate over rendered: balance * true albedo / assumed albedo
  glm::dvec3 sigma{0};    // standard deviation of its logarithm
  bool reference = false;
};

struct Balance {
  glm::dvec3 scale{1};  // factor of the light camera's radiance
  glm::dvec3 sigma{0};  // standard deviation of its logarithm
  std::vector<SurfaceRatio> surfaces;
  std::vector<std::string> notes;
};

// A surface's ratio is the median over tiles of the median over the tile's pixels of log(plate /
// rendered). Its deviation is that of a median (1.2533 times the mean's) over tiles, from their
// median absolute deviation. The balance is the weighted median over the reference surfaces (if
// `references` is empty, the tags' paper alone, whose colour is known, and where none is seen, over
// all, as if as many albedos were too low as too high), so that one wrong albedo among three does
// no harm. A surface's weight is one over its variance and that of an albedo, so that one that is
// hardly known moves nothing. The balance's deviation is computed in the same way, and is never
// below that of one surface alone. Throws previz::Error if no surface can be used or a reference is
// not among those seen, naming those that are.
Balance fit_balance(const SurfacePixels& seen, const std::vector<std::string>& references);

// Returns how far the exposures that the two cameras state are from what is seen, in stops of
// luminance. Above 0 the light camera stated too much exposure, so its light comes out too dark.
double exposure_error_stops(const Balance& balance);
double exposure_error_sigma_stops(const Balance& balance);

// The albedo that the plate shows under the balanced light, to first order in the light that
// surfaces reflect onto each other. `sigma` is of the albedo.
struct AlbedoEstimate {
  glm::dvec3 albedo{0};
  glm::dvec3 sigma{0};
};
AlbedoEstimate albedo_of(const SurfaceRatio& surface, const KnownSurface& known,
                         const Balance& balance);

}  // namespace previz::calibrate
