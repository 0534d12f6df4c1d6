// Estimates how far a picture is from converged, and which parts of it need more samples. Errors
// are counted as they are seen: what the sensor clips (Layers::white) is white, however noisy it is
// above that.
#pragma once

#include <cstdint>
#include <vector>

#include "daemon/render/layers.hpp"

namespace previz::render {

struct ErrorEstimate {
  double picture = 0;         // rms standard error of the composite over its rms radiance
  std::vector<float> blocks;  // each block's rms standard error over the picture's rms radiance:
                              // what the block adds to `picture`; 8x8 pixels, row-major
};

// Estimates the error from the layers' own variance. It needs two samples per pixel; with fewer the
// result is 0.
ErrorEstimate estimate_error(const Layers& layers);

// Returns whether each block's error, or that of a block next to it, is above `error`: a block's
// own estimate may have missed rare events.
std::vector<bool> blocks_above(const ErrorEstimate& estimate, int width, int height, double error);

// Returns how many samples the pixels of each block get, in the form of Renderer::limit_samples(),
// so that the picture's squared error is least for `samples` per pixel on average: in proportion to
// the error that one sample leaves in the block, smoothed over its neighbours. `estimate` must come
// from the same number of samples everywhere. A block gets at least an eighth of the average,
// because the estimate may have missed something, and at most eight times the average, because few
// samples only give a rough estimate of the noise.
std::vector<std::uint32_t> spread_samples(const ErrorEstimate& estimate, int width, int height,
                                          int samples);

}  // namespace previz::render
