// Resamples the pixels of a fisheye picture to the texels of an octahedral map and preserves
// energy.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "daemon/core/lighting/hdr.hpp"
#include "daemon/core/lighting/viewpoint.hpp"
#include "drivers/calibration/fisheye.hpp"

namespace previz::lighting {

// The share of each texel's solid angle that each pixel covers. It depends on lens, pose and room
// only, so one resampling serves every frame of a fixed light camera. The pixels of texel t (index
// into EnvironmentMap::radiance) are entries first[t] .. first[t + 1] - 1.
struct Resampling {
  int size = 0;  // texels a side of the map
  std::vector<std::uint32_t> first;
  std::vector<std::uint32_t> pixels;  // y * width + x
  std::vector<float> weights;         // share of a texel; they add up to its seen part
};

// Divides every texel into cells of about a pixel or less, and each cell into 4x4 directions of
// equal solid angle, or up to 64x64 where a room looks so much smaller from the camera that a cell
// holds many pixels. A direction takes the pixel that it falls in.
Resampling make_resampling(const Fisheye& lens, const Viewpoint& viewpoint, int size);

// The part of the picture that falls into each texel.
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
