// Averages light over time where it stays the same, and follows it at once where it changes.
#pragma once

#include <cstdint>
#include <vector>

#include "daemon/core/lighting/hdr.hpp"

namespace previz::lighting {

// Keeps an exponential average of merged pictures of one camera that stands still. A pixel counts
// as changed if its new radiance differs by more than 5 standard deviations of the difference, in
// any channel, or if the mean of a square around it does. The squares have 2, 4, 8 ... pixels a
// side, up to the whole picture; larger ones are less noisy, and pixels that have changed by
// themselves are left out of them. So the dim light that a lamp leaves on a wall goes with the
// lamp. Changed pixels start anew.
// The standard deviation follows from both pictures' own noise estimates, scaled up by as much as 4
// where the median of all differences shows that they are noisier than that, as in robust
// statistics.
class Smoothing {
 public:
  // A time constant of 0 s leaves pictures as they are.
  explicit Smoothing(double time_constant_s) : time_constant_s_(time_constant_s) {}

  // Replaces radiance and variance by the averages up to this picture. Times must rise; a picture
  // of another size starts anew. Flags stay those of the new picture.
  void operator()(HdrPicture& picture, std::int64_t timestamp_ns);

 private:
  const double time_constant_s_;
  HdrPicture average_;  // no flags
  std::int64_t timestamp_ns_ = 0;
};

}  // namespace previz::lighting
