// Brackets of exposures of one scene, merged in linear light with noise-weighted averaging.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::lighting {

// Flags of a pixel of a merged picture.
inline constexpr std::uint8_t overexposed = 1;   // a channel is clipped in every exposure
inline constexpr std::uint8_t underexposed = 2;  // every channel is black in every exposure

// Linear Rec. 709 radiance, row-major. An over-exposed channel holds the least radiance that clips
// the shortest exposure, an under-exposed one 0.
struct HdrPicture {
  int width = 0;
  int height = 0;
  std::vector<glm::vec3> radiance;
  std::vector<std::uint8_t> flags;
};

// What a sensor is taken to add to a signal s in [0, 1]: variance = s * signal_per_electron +
// read_noise^2, besides rounding to codes. Only ratios between exposures depend on it.
struct SensorNoise {
  double signal_per_electron = 1.0 / 30000;
  double read_noise = 3e-4;  // standard deviation, of the signal
};

// Frames of any count, order and exposure, of one size. Each channel of a pixel is the average of
// signal / exposure over the frames whose code is not clipped, with weights exposure^2 / variance:
// the variance and the range of codes that count are judged at the radiance found in a first round
// (sum of signals / sum of exposures), not at each noisy code, so that noise does not bias the
// average. Samples near black and white count only where nothing better is there. Where every
// frame is clipped or black, see HdrPicture.
// Throws previz::Error naming the frame whose exposure or size cannot be used.
HdrPicture merge_exposures(std::span<const FramePtr> frames, const ResponseCurve& response,
                           const SensorNoise& noise = {});

// Exposures of the same step belong to one place of a bracket: steps of 1 %, so that an automatic
// exposure that wanders does not pile up frames. `exposure` is above 0.
long exposure_step(double exposure);

}  // namespace previz::lighting
