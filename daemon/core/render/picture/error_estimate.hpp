// Estimates how far a picture is from converged, and which parts of it need more samples. Errors
// are counted as they are seen: what the sensor clips (Layers::white) is white, however noisy it is
// above that.
#pragma once

#include <cstdint>
#include <vector>

#include "daemon/core/render/picture/layers.hpp"

namespace previz::render {

struct ErrorEstimate {
  double picture = 0;         // rms standard error of the composite over its rms radiance
  std::vector<float> blocks;  // each block's rms standard error over the picture's rms radiance:
                              // what the block adds to `picture`; 8x8 pixels, row-major
  std::vector<float> parts;   // the same of each part of each block (Renderer::limit_parts)
};

// Estimates the error from the layers' own variance. It needs two samples per pixel; with fewer the
// result is 0.
ErrorEstimate estimate_error(const Layers& layers);

// Returns which parts of blocks need more samples to come down to `error`; `samples` is the number
// that the pixels of each have. A part is judged by the noise of other pixels, those of the part
// that follows in its own block and, half as a whole, in the blocks next to it, as much of it as
// the part's own number of samples would leave. If its own noise decided, a part that by chance has
// missed rare bright light would end, and the picture would be too dark (Kirk and Arvo 1991,
// "Unbiased Sampling Techniques for Image Synthesis"). Each part judges the one before it in a
// circle of four, so what a part has met comes back to it after three rounds at the earliest, by
// way of the numbers of samples that the others got. The parts must have independent random numbers
// (Renderer::separate_parts); only the brightness of the whole picture, to which errors are
// relative, has something of all.
std::vector<bool> parts_above(const ErrorEstimate& estimate, int width, int height, double error,
                              const std::vector<std::uint32_t>& samples);

// Returns how many samples the pixels of each block get, in the form of Renderer::limit_samples(),
// so that the picture's squared error is least for `samples` per pixel on average: in proportion to
// the error that one sample leaves in the block, smoothed over its neighbours. `estimate` must come
// from the same number of samples everywhere. A block gets at least an eighth of the average,
// because the estimate may have missed something, and at most eight times the average, because few
// samples only give a rough estimate of the noise.
std::vector<std::uint32_t> spread_samples(const ErrorEstimate& estimate, int width, int height,
                                          int samples);

}  // namespace previz::render
