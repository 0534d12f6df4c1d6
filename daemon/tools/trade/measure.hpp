// Measures the error of a picture against a reference, and finds the best of many (time, error)
// pairs.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/core/render/picture/composite.hpp"
#include "daemon/core/render/picture/layers.hpp"

namespace previz::trade {

// A composite for measuring errors: linear radiance, row-major, clipped at the sensor's white,
// because one mirrored lamp would otherwise outweigh everything else.
struct TradePicture {
  int width = 0, height = 0;
  std::vector<glm::vec3> shown;  // the composite
  std::vector<glm::vec3> added;  // the composite minus the camera's picture
  std::vector<float> mask;       // mean(M)
};

// Makes a TradePicture of layers. `camera` is the plate's radiance; `white` is the
// radiance at which the sensor clips.
TradePicture trade_picture(const render::Layers& layers, const render::PlateRadiance& camera,
                           double white);

// Relative errors: the rms of the error over the rms of the quantity itself, over pixels and
// channels. An error is absent if the quantity is 0 everywhere.
struct TradeErrors {
  std::optional<double> difference;    // of the light added to the camera's picture where M = 0
  std::optional<double> virtual_part;  // of the composite where M = 1
  std::optional<double> picture;       // of the composite everywhere: `previz render --error`
};

// The square of a relative error, with its standard deviation. Independent errors add up by their
// squares, so that those of a noisy reference can be subtracted; what is left may be below 0.
struct SquaredError {
  double value = 0, deviation = 0;
};
// Returns the root, and how far it may be off: the half width of the roots of value +- deviation.
double error_of(const SquaredError& squared);
double deviation_of(const SquaredError& squared);
// Returns the mean of squared errors that were measured independently; there must be one.
SquaredError mean(std::span<const SquaredError> squared);

// A long render in two independent halves, against which errors are measured.
class TradeReference {
 public:
  TradeReference(const TradePicture& a, const TradePicture& b);

  const TradePicture& picture() const { return mean_; }
  // Returns the square of how far a picture is from the truth, which is the square of its
  // TradeErrors::picture without the reference's own noise. The picture must be independent of the
  // reference. The deviation is that of sums over 8x8 pixels, as if all of how these differ were
  // chance: at most so much.
  SquaredError squared_error(const TradePicture& picture) const;
  // The same for a picture that shares samples with the reference's first half: by the second.
  SquaredError squared_error_by_second_half(const TradePicture& picture) const;
  // Returns the standard error of the halves' mean: half their difference.
  const TradeErrors& noise() const { return noise_; }
  const SquaredError& squared_noise() const { return own_; }
  // Returns the errors of `picture`, which must have the reference's size.
  TradeErrors errors(const TradePicture& picture) const;

  // The bias of a method: how far its pictures are from the set's `own` with the same samples and
  // random numbers, beyond noise, as rms over the rms of the reference's composite. If d and e are
  // the differences of two rounds, the expectation of d e is the square of the bias, because their
  // noise is independent; the estimate is the mean of d e over all pairs of rounds, of which there
  // must be at least three. The reference cannot show the bias: a picture of few samples, clipped,
  // differs from it without being wrong.
  struct Bias {
    double value = 0;  // 0: no bias is detected
    double least = 0;  // least bias that would be detected: three standard errors of that mean
  };
  Bias bias(std::span<const TradePicture> alike, std::span<const TradePicture> own) const;

 private:
  TradePicture mean_, second_;
  SquaredError own_;  // of the mean
  TradeErrors noise_;
};

// Returns the rms of each error over several pictures made alike.
TradeErrors rms(std::span<const TradeErrors> errors);

// Returns the names of errors that are less than ten times the reference's own: "e_diff e_picture".
std::string within_noise(const TradeErrors& errors, const TradeErrors& noise);

struct TradeCost {
  double seconds = 0;
  double error = 0;
};

// Returns for each cost whether it is on the Pareto front: no other is at most as slow and at most
// as wrong, and better in one of the two.
std::vector<bool> pareto_front(std::span<const TradeCost> costs);

// Returns the index of the front's bend: with both axes logarithmic and the ends at (0, 1) and (1,
// 0), the inner point that is furthest below the line through the ends, or least above it; 0 if
// there is no inner point. `front` must not be empty and is in order of time; its costs are above
// 0.
std::size_t knee(std::span<const TradeCost> front);

}  // namespace previz::trade
