// Which light source is which from one light frame to the next.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "daemon/lighting/environment.hpp"

namespace previz::lighting {

// Nothing here can make a lamp late: what is found is there at once, what is not is gone at once,
// and the flux is what was found, so that sources and residual still add up to the image. Direction
// and solid angle, which noise makes tremble, are smoothed with the time constant as long as they
// do no more than that.
class SourceTracker {
 public:
  explicit SourceTracker(double time_constant_s) : time_constant_s_(time_constant_s) {}

  // Gives sources that were there before their ids, nearest first, and new ones the next free ids,
  // from 1. Times must not go back.
  void follow(std::vector<Source>& sources, std::int64_t timestamp_ns);

  // As they were last.
  std::span<const Source> known() const { return known_; }

 private:
  const double time_constant_s_;
  std::vector<Source> known_;
  std::int64_t last_ns_ = 0;
  int last_id_ = 0;
};

}  // namespace previz::lighting
