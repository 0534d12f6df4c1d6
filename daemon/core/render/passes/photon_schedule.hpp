// Decides how many photons a pass emits and over which radius they are gathered (shaders/README.md,
// "Caustics").
#pragma once

#include <cstdint>

namespace previz::render {

// Returns the radius of a pass (0, 1, ...) over that of pass 0: r^2 shrinks by (n + 2/3) / (n + 1)
// after pass n.
double photon_radius_factor(std::uint64_t pass);

// Returns the number of photons per pass, from the set's number per pixel: at least 1024, at most
// `most`.
std::uint32_t photon_count(double photons_per_pixel, int width, int height, std::uint32_t most);

}  // namespace previz::render
