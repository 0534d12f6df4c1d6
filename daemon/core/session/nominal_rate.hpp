// Finds the rate at which a camera was set to take frames, from the times of those it took.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace previz::session {

// Frames that are not there, by the times of their neighbours.
struct RateGap {
  std::size_t after = 0;    // index of the frame before the gap
  std::int64_t frames = 0;  // so many are missing
};

struct NominalRate {
  double fps = 25;
  bool is_standard = true;  // a whole number, or one over 1.001 (23.976, 29.97 ...)
  bool varies = false;  // more than a tenth of the frames are not at multiples of the usual time
  std::vector<RateGap> gaps;  // none if it varies: nobody knows what should be there
};

// Times in nanoseconds, increasing. The median of their differences is one frame's time, so that a
// dropped frame or a pause does not count; the rate is the frames' number, with those in gaps, over
// their time, and the standard rate nearest to it if that is as near as clocks and rounded times
// are. Of fewer than two times the rate is 25.
NominalRate nominal_rate(std::span<const std::int64_t> times_ns);

// Returns the numerator and denominator of a rate: 30000, 1001 for 29.97. Both are at least 1; a
// finite rate that has no such fraction, beyond 2^31 - 1 or its inverse, becomes the nearest.
struct RateFraction {
  int frames, seconds;
};
RateFraction fraction_of(double fps);

// Says it in plain words: "29.97 frames a second; 1 frame is missing after frame 52".
std::string words_of(const NominalRate& rate);

}  // namespace previz::session
