// Merges brackets of exposures of one scene in linear light, with noise-weighted averaging.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "daemon/core/lighting/bracket.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::lighting {

// Flags of a pixel of a merged picture.
inline constexpr std::uint8_t overexposed = 1;   // a channel is clipped in every exposure
inline constexpr std::uint8_t underexposed = 2;  // every channel is black in every exposure
inline constexpr std::uint8_t moved = 4;         // older exposures that disagree were left out

// Linear Rec. 709 radiance, row-major. An over-exposed channel holds the least radiance that clips
// the shortest exposure, an under-exposed one 0.
struct HdrPicture {
  int width = 0;
  int height = 0;
  std::vector<glm::vec3> radiance;
  std::vector<std::uint8_t> flags;
  std::vector<glm::vec3> variance = {};  // of the radiance, from noise and rounding
};

// Merges frames of any count, order and exposure, of one size.
//
// Going from the newest exposure to the oldest, an exposure that contradicts the newer ones in a
// pixel is left out of that pixel. It contradicts them if a channel differs by more than 5 standard
// deviations of their noise and the calibration's error; a clipped code means at least white.
// Whatever has moved or was switched is thus shown as it is now and leaves no ghost.
//
// Each channel of a pixel is the average of signal / exposure over the remaining frames whose code
// is not clipped, with weights exposure^2 / variance. The variance and the usable range of codes
// are judged at the radiance found in a first round (sum of signals / sum of exposures), not at
// each noisy code, so that noise does not bias the average. Samples near black and white count only
// if there is nothing better. Where every frame is clipped or black, see HdrPicture.
HdrPicture merge(const Bracket& bracket, const SensorNoise& noise = {});

}  // namespace previz::lighting
