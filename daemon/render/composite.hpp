// From accumulated pixels and the plate to layers and to the picture that is shown (P2, P5).
#pragma once

#include <span>
#include <vector>

#include "daemon/lighting/response.hpp"
#include "daemon/render/layers.hpp"
#include "drivers/frame.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

// The plate as linear radiance, interleaved RGB: inverse_response(sample) / exposure.
std::vector<double> plate_radiance(const Plate& plate, const lighting::Response& response,
                                   double exposure);

// All layers from per-pixel sums of `samples` samples (> 0) and the plate's radiance (empty:
// black). composite = mean(M) mean(Lm) + (1 - mean(M)) (Lc + mean(Lm - Lr)), which is
// estimator.md's mean(Lm) + (1 - mean(M)) (Lc - mean(Lr)) without subtracting two large sums.
Layers make_layers(std::span<const gpu::GpuPixel> pixels, int width, int height,
                   std::int64_t samples, std::span<const double> plate);

// The composite through exposure and response. Where nothing virtual touches a pixel (mask and diff
// exactly 0) it is the plate's own samples, bit for bit.
Plate make_picture(const Layers& layers, const Plate& plate, const lighting::Response& response,
                   double exposure);

}  // namespace previz::render
