// Turns accumulated pixels and the plate into layers, in double precision (P2; shaders/README.md,
// "The composite").
#pragma once

#include <span>
#include <vector>

#include "daemon/lighting/response.hpp"
#include "daemon/render/layers.hpp"
#include "daemon/set/set.hpp"
#include "drivers/frame.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

// The plate as linear radiance, interleaved RGB: `value` is inverse_response(sample) / exposure;
// `variance` is what rounding to samples leaves in it, the squared step between neighbouring codes
// over 12.
struct PlateRadiance {
  std::vector<double> value, variance;
};
PlateRadiance plate_radiance(const Plate& plate, const lighting::Response& response,
                             double exposure);

// The rule by which the difference D of the worlds is put onto the camera's Lc where nothing
// virtual covers it (shaders/README.md, "The composite"), per channel and on means over the pixel's
// samples, never sample by sample:
//   additive  Lc + D                             the paper's; an error in the assumed albedo stays
//   ratio     Lc Lm / Lr, Lc where Lr = 0        cancels that error; lights no black surface
//   hybrid    Lc + D (Lr Lc + s^2) / (Lr^2 + s^2), s^2 the plate's variance plus floor^2
struct CompositeRule {
  set::Composite kind = set::Composite::additive;
  double floor = 0;  // radiance; used by hybrid
};

// Returns all-zero layers of this size. `samples` is the largest number of samples that a pixel
// has.
Layers make_layers(int width, int height, std::int64_t samples);

// Fills in all layers of the pixels from index `first` on, row-major, from the pixels' sums and the
// plate of the whole picture (empty: black). The composite is mean(M) mean(Lm) + (1 - mean(M)) U,
// where U follows from `rule`. With the additive rule it equals mean(Lm) + (1 - mean(M)) (Lc -
// mean(Lr)), but no two large sums are subtracted (shaders/README.md, "The composite").
void composite(Layers& layers, std::size_t first, std::span<const gpu::GpuPixel> pixels,
               const PlateRadiance& plate, const CompositeRule& rule = {});

}  // namespace previz::render
