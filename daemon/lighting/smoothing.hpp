// Light averaged over time where it stays the same, and at once as it is where it changes.
#pragma once

#include <cstdint>
#include <vector>

#include "daemon/lighting/hdr.hpp"

namespace previz::lighting {

// An exponential average of merged pictures of one camera that stands still. A pixel has changed
// where its new radiance lies beyond 5 standard deviations of the difference, in any channel; or
// where the mean of a square around it does: of 2, 4, 8 ... pixels a side up to the whole picture,
// less noisy the larger they are, and without what has changed by itself. So the dim light that a
// lamp leaves on a wall goes with the lamp. What has changed starts anew.
// The standard deviation is what both pictures say of their own noise, or up to 4 times as much
// where their difference is so noisy all over: by its median, as in robust statistics.
class Smoothing {
 public:
  // 0 s: pictures pass as they are.
  explicit Smoothing(double time_constant_s) : time_constant_s_(time_constant_s) {}

  // Replaces radiance and variance by the averages up to this picture. Times in rising order; a
  // picture of another size starts anew. Flags are the new picture's own.
  void operator()(HdrPicture& picture, std::int64_t timestamp_ns);

 private:
  const double time_constant_s_;
  HdrPicture average_;  // no flags
  std::int64_t timestamp_ns_ = 0;
};

}  // namespace previz::lighting
