// The light around the set: radiance over all directions, at infinity, as an equal-area
// octahedral map.
#pragma once

#include <glm/vec3.hpp>
#include <string>
#include <vector>

namespace previz::lighting {

// Texel (i, j) covers the square [-1 + 2 i/size, -1 + 2 (i+1)/size] x (same for j) of
// shaders/lib/octahedral.h; every texel has solid angle 4 pi / size^2. World directions, Z up.
// radiance[j * size + i] is the mean linear Rec. 709 radiance over the texel.
struct EnvironmentMap {
  int size = 0;  // texels a side, a power of two
  std::vector<glm::vec3> radiance;
};

// How the map came to be; printed, and recorded with the frame.
struct EnvironmentReport {
  double seen_sr = 0;         // solid angle measured by the camera
  double filled_sr = 0;       // filled by the unseen rule
  double overexposed_sr = 0;  // clipped in every exposure; radiance there is a lower bound
  double underexposed_sr = 0; // black in every exposure
  std::vector<std::string> notes;
};

struct Lighting {
  EnvironmentMap environment;
  EnvironmentReport report;
};

}  // namespace previz::lighting
