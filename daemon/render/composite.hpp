// From accumulated pixels and the plate to layers and to the picture that is shown (P2, P5).
#pragma once

#include <span>
#include <vector>

#include "daemon/lighting/response.hpp"
#include "daemon/render/layers.hpp"
#include "daemon/set/set.hpp"
#include "drivers/frame.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

// The plate as linear radiance, interleaved RGB: inverse_response(sample) / exposure; and the
// variance that rounding to samples leaves in it: the step between neighbours, squared, over 12.
struct PlateRadiance {
  std::vector<double> value, variance;
};
PlateRadiance plate_radiance(const Plate& plate, const lighting::Response& response,
                             double exposure);

// How the difference D of the worlds is put onto the camera's Lc where nothing virtual covers it
// (estimator.md), per channel and on means over the pixel's samples, never sample by sample:
//   additive  Lc + D                             the paper's; keeps an error in the assumed albedo
//   ratio     Lc Lm / Lr, Lc where Lr = 0        cancels it, but lights no black surface
//   hybrid    Lc + D (Lr Lc + s^2) / (Lr^2 + s^2), s^2 the plate's variance plus floor^2
struct CompositeRule {
  set::Composite kind = set::Composite::additive;
  double floor = 0;  // radiance, of hybrid
};

// All layers from per-pixel sums and the plate (empty: black). `samples`: the most a pixel has.
// composite = mean(M) mean(Lm) + (1 - mean(M)) U with U by `rule`; with additive that is
// estimator.md's mean(Lm) + (1 - mean(M)) (Lc - mean(Lr)) without subtracting two large sums.
Layers make_layers(std::span<const gpu::GpuPixel> pixels, int width, int height,
                   std::int64_t samples, const PlateRadiance& plate,
                   const CompositeRule& rule = {});

// The composite through exposure and response. Where nothing virtual touches a pixel, so that it
// has the plate's own radiance, it is the plate's own samples, bit for bit.
Plate make_picture(const Layers& layers, const Plate& plate, const lighting::Response& response,
                   double exposure);

}  // namespace previz::render
