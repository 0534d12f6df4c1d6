// How wrong a picture is against a reference, and which of many (time, error) pairs are worth it.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/render/layers.hpp"

namespace previz::trade {

// A composite as errors are measured on it: linear radiance, clipped at the sensor's white, or one
// mirrored lamp would outweigh all else. Row-major.
struct TradePicture {
  int width = 0, height = 0;
  std::vector<glm::vec3> shown;  // the composite
  std::vector<glm::vec3> added;  // the composite less the camera's picture
  std::vector<float> mask;       // mean(M)
};

// `camera`: the plate's radiance, interleaved RGB; `white`: the radiance where the sensor clips.
TradePicture trade_picture(const render::Layers& layers, const std::vector<double>& camera,
                           double white);
// The same picture with more pixels, bilinear.
TradePicture enlarged(const TradePicture& picture, int width, int height);

// Rms of an error over the rms of what it is an error of, over pixels and channels. Absent where
// the latter is 0: there is nothing of the kind in the picture.
struct TradeErrors {
  std::optional<double> difference;    // of what is put onto the camera's picture; where M = 0
  std::optional<double> virtual_part;  // of the composite where M = 1
  std::optional<double> picture;       // of the composite everywhere: `previzd render --error`
};

// Two independent halves.
class TradeReference {
 public:
  TradeReference(const TradePicture& a, const TradePicture& b);

  const TradePicture& picture() const { return mean_; }
  // Standard error of the halves' mean: half their difference.
  const TradeErrors& noise() const { return noise_; }
  // `picture` has the reference's size.
  TradeErrors errors(const TradePicture& picture) const;

  // How far pictures made alike are from the set's `own` with the same samples and random numbers,
  // beyond noise: rms over the rms of the reference's composite. Of the differences d and e of two
  // pairs, d e is the square of that in expectation, because independent noise does not multiply
  // up; here its mean over all pairs of pairs, of which there must be at least three. The
  // reference itself cannot tell: few samples, clipped, are off from it without being wrong.
  struct Bias {
    double value = 0;  // 0: none is seen
    double least = 0;  // what would have been seen: three standard errors of that mean
  };
  Bias bias(std::span<const TradePicture> alike, std::span<const TradePicture> own) const;

 private:
  TradePicture mean_;
  TradeErrors noise_;
};

// Errors of several pictures made alike: the rms of each.
TradeErrors rms(std::span<const TradeErrors> errors);

// "e_diff e_picture": which errors are less than ten times the reference's own.
std::string within_noise(const TradeErrors& errors, const TradeErrors& noise);

struct TradeCost {
  double seconds = 0;
  double error = 0;
};

// Whether each is on the Pareto front: no other is at most as slow and at most as wrong, and in one
// of the two better.
std::vector<bool> pareto_front(std::span<const TradeCost> costs);

// The index of the front's bend: with both axes logarithmic and the ends at (0, 1) and (1, 0), the
// point between them that is furthest below the line that joins them, or least above it; 0 where
// there is none between them. `front` is not empty, in order of time; its costs are
// above 0.
std::size_t knee(std::span<const TradeCost> front);

}  // namespace previz::trade
