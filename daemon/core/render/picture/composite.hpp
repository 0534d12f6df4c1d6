// Turns accumulated pixels and the plate into layers, in double precision (P2; shaders/README.md,
// "The composite").
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/render/picture/layers.hpp"
#include "daemon/core/set/set.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

// What the camera measured in one channel of a pixel.
struct MeasuredChannel {
  double radiance = 0;  // inverse_response(sample) / exposure
  double variance = 0;  // what rounding to samples leaves: the squared step between codes over 12
  double clipped = 0;   // 0 to 1: how far the code means "at least this much" (lighting::Clipping)
};

// The plate as linear radiance: what each of its codes stands for.
struct PlateRadiance {
  std::vector<MeasuredChannel> of_code;
  std::span<const std::uint16_t> codes;  // the plate's samples, interleaved RGB

  // Returns zeros if there is no plate. A device makes a smaller preview's plate; one that fails
  // may bring any code, and one that no camera has counts as the largest.
  MeasuredChannel channel(std::size_t pixel, int channel) const;
};
// The result looks into the plate, which must outlive it.
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

// What the samples say about one channel of a pixel.
struct Estimate {
  double change = 0;     // mean(Lm) - (1 - mean(M)) mean(Lr): what is added to (1 - mean(M)) Lc
  double mask = 0;       // mean(M)
  double uncovered = 0;  // mean((1 - M)(Lm - Lr)): the part of `change` that the rule multiplies
  double real = 0;       // mean(Lr)
};

// Returns the composite of one channel. A clipped channel stands for the model's mean(Lr) where
// that is brighter, so that a shadow first takes what the sensor could not show; the result is then
// no brighter than the plate or than the composite with the plate as it is. A shadow leaves at
// least no light: where the model's real world is brighter than the picture, the rule alone would
// give less, and below_zero() counts it.
double compose(const CompositeRule& rule, const MeasuredChannel& camera, const Estimate& estimate);

// Returns the number of pixels that nothing virtual covers and in which a shadow left no light in
// some channel.
std::uint64_t below_zero(const Layers& layers);

// Returns the factor that a small error of the change has in the composite: the rule's gain where
// nothing covers the pixel, and 1 where it is covered.
double gain_of(const CompositeRule& rule, const MeasuredChannel& camera, const Estimate& estimate);

// Returns all-zero layers of this size. `samples` is the largest number of samples that a pixel
// has.
Layers make_layers(int width, int height, std::int64_t samples,
                   const std::shared_ptr<Scratch>& scratch = {});

// Fills in all layers of the pixels from index `first` on, row-major, from the pixels' sums and the
// plate of the whole picture (empty: black). With the additive rule the composite equals mean(Lm) +
// (1 - mean(M)) (Lc - mean(Lr)), but no two large sums are subtracted (shaders/README.md, "The
// composite").
void composite(Layers& layers, std::size_t first, std::span<const gpu::GpuPixel> pixels,
               const PlateRadiance& plate, const CompositeRule& rule = {});

}  // namespace previz::render
