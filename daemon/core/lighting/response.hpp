// Applies camera response curves, both ways, exactly on every code value (P5).
#pragma once

#include <cstdint>
#include <vector>

#include "drivers/calibration.hpp"

namespace previz::lighting {

// A clipped code means "at least so much light", because the sensor, or what came after it, could
// show no more. Codes from `at` on are clipped wholly, those below `from` not at all, and between
// them the share rises evenly, so that nothing jumps where a picture runs into white.
struct Clipping {
  std::uint32_t from = 0, at = 0;
  float share(std::uint32_t code) const;
};

// `inverse` has 2^bits entries: the linear signal (exposure * radiance) that each sample stands
// for, with inverse[0] = 0 and inverse[max] = 1. forward(inverse[v]) == v for every v: the
// constructor checks it and throws previz::Error saying which code the curve cannot return.
// Kind::srgb is IEC 61966-2-1 with the linear part up to a signal of 0.0031308; a table is linear
// between its entries.
class Response {
 public:
  // `bits` is 1 to 16.
  Response(const ResponseCurve& curve, int bits);
  int bits() const { return bits_; }
  const std::vector<double>& inverse() const { return inverse_; }
  // Returns floor(max * curve(clip(signal)) + 0.5). NaN becomes 0 and is the caller's bug.
  std::uint16_t forward(double signal) const;
  // Returns which codes count as clipped, which follows from the curve's clip_share.
  Clipping clipping() const;
  // Returns the least signal that forward() maps to this code, up to rounding; 0 for code 0.
  double least_signal(std::uint16_t code) const;

 private:
  ResponseCurve curve_;
  int bits_;
  std::vector<double> inverse_;
};

}  // namespace previz::lighting
