// How far a picture is from converged, and which parts of it need more samples.
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

// 1 for each block whose error is above `error`, as Renderer::sample_only() takes them. A block
// next to such a one is sampled too: its own estimate may have missed what is rare.
std::vector<std::uint32_t> blocks_above(const ErrorEstimate& estimate, int width, int height,
                                        double error);

}  // namespace previz::render
