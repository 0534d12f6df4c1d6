// From the pixels of a fisheye picture to the texels of an octahedral map, energy kept.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "daemon/lighting/hdr.hpp"
#include "daemon/lighting/viewpoint.hpp"
#include "drivers/calibration/fisheye.hpp"

namespace previz::lighting {

// How much of each texel's solid angle each pixel covers; depends on lens, pose and room only, so
// one serves every frame of a fixed light camera. The pixels of texel t (index into
// EnvironmentMap::radiance) are entries first[t] .. first[t + 1] - 1.
struct Resampling {
  int size = 0;  // of the map, texels a side
  std::vector<std::uint32_t> first;
  std::vector<std::uint32_t> pixels;  // y * width + x
  std::vector<float> weights;         // of a texel; they add up to the part that is seen
};

// Every texel is divided into cells of about a pixel or less and these into 4x4 directions of equal
// solid angle, or up to 64x64 where a room is seen so much smaller than from the camera that a cell
// holds many pixels; a direction takes the pixel whose square it falls in.
Resampling make_resampling(const Fisheye& lens, const Viewpoint& viewpoint, int size);

// What the picture says about each texel.
struct Resampled {
  int size = 0;
  std::vector<glm::vec3> radiance;  // integral over the texel's seen part / the texel's solid angle
  std::vector<float> seen;          // seen part of the texel, 0..1
  double overexposed_sr = 0;
  double underexposed_sr = 0;
  double moved_sr = 0;
};

Resampled resample(const Resampling& resampling, const HdrPicture& picture);

}  // namespace previz::lighting
