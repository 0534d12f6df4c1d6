// How far a picture is from converged, and which parts of it need more samples. Errors are those
// that are seen: what the sensor clips (Layers::white) is white, however noisy it is above that.
#pragma once

#include <cstdint>
#include <vector>

#include "daemon/render/layers.hpp"

namespace previz::render {

struct ErrorEstimate {
  double picture = 0;         // rms standard error of the composite over its rms radiance
  std::vector<float> blocks;  // the same of each block of 8x8 pixels, row-major, over the
                              // picture's rms radiance: what the block adds to the picture's
};

// From the layers' own variance; needs two samples a pixel (0 before).
ErrorEstimate estimate_error(const Layers& layers);

// Whether each block's error is above `error`. A block next to such a one is, too: its own estimate
// may have missed what is rare.
std::vector<bool> blocks_above(const ErrorEstimate& estimate, int width, int height, double error);

// How many samples the pixels of each block get, as Renderer::limit_samples() takes them, so that
// the picture's squared error is least for `samples` a pixel on average: in proportion to the
// error a sample leaves there, which `estimate` tells of samples that were the same for all; blocks
// are smoothed with their neighbours. No less than an eighth of the average, for what the estimate
// has missed, and no more than eight times it, because few samples tell the noise only roughly.
std::vector<std::uint32_t> spread_samples(const ErrorEstimate& estimate, int width, int height,
                                          int samples);

}  // namespace previz::render
