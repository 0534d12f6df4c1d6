// Brackets of exposures of one scene, merged in linear light with noise-weighted averaging.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "daemon/lighting/bracket.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::lighting {

// Flags of a pixel of a merged picture.
inline constexpr std::uint8_t overexposed = 1;   // a channel is clipped in every exposure
inline constexpr std::uint8_t underexposed = 2;  // every channel is black in every exposure
inline constexpr std::uint8_t moved = 4;  // older exposures contradict newer ones, were left out

// Linear Rec. 709 radiance, row-major. An over-exposed channel holds the least radiance that clips
// the shortest exposure, an under-exposed one 0.
struct HdrPicture {
  int width = 0;
  int height = 0;
  std::vector<glm::vec3> radiance;
  std::vector<std::uint8_t> flags;
  std::vector<glm::vec3> variance = {};  // of the radiance, by noise and rounding
};

// Frames of any count, order and exposure, of one size.
//
// Going from the newest exposure to the oldest, one that contradicts the newer ones in a pixel
// (beyond 5 standard deviations of their noise and the calibration's error, in any channel; clipped
// means at least white) is left out there: what has moved, or was switched, is shown as it is now
// and leaves no ghost.
//
// Of the others each channel of a pixel is the average of signal / exposure over the frames whose
// code is not clipped, with weights exposure^2 / variance: the variance and the range of codes that
// count are judged at the radiance found in a first round (sum of signals / sum of exposures), not
// at each noisy code, so that noise does not bias the average. Samples near black and white count
// only where nothing better is there. Where every frame is clipped or black, see HdrPicture.
HdrPicture merge(const Bracket& bracket, const SensorNoise& noise = {});

}  // namespace previz::lighting
