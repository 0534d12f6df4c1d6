// Camera response curves, both ways, exact on every code value (P5).
#pragma once

#include <cstdint>
#include <vector>

#include "drivers/calibration.hpp"

namespace previz::lighting {

// inverse: for a `bits`-bit sample, the linear signal (exposure * radiance) it stands for;
// 2^bits entries, inverse[0] = 0 and inverse[max] = 1. forward(inverse[v]) == v for every v: the
// constructor checks it and throws previz::Error saying which code the curve cannot return.
// Kind::srgb is IEC 61966-2-1 with the linear part up to a signal of 0.0031308; a table is linear
// between its entries.
class Response {
 public:
  // `bits`: 1 to 16.
  Response(const ResponseCurve& curve, int bits);
  int bits() const { return bits_; }
  const std::vector<double>& inverse() const { return inverse_; }
  // floor(max * curve(clip(signal)) + 0.5); NaN becomes 0 and is the caller's bug.
  std::uint16_t forward(double signal) const;
  // The least signal that forward() makes this code of, but for rounding; 0 for code 0.
  double least_signal(std::uint16_t code) const;

 private:
  ResponseCurve curve_;
  int bits_;
  std::vector<double> inverse_;
};

}  // namespace previz::lighting
