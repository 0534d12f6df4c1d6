// Matches light sources from one light frame to the next.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "daemon/core/lighting/environment.hpp"

namespace previz::lighting {

// Tracking never delays a lamp: a source appears and disappears in the frame in which it does so in
// the picture, and its flux is the measured one, so that sources and residual still add up to the
// image. Direction and solid angle, which noise makes jitter, are smoothed with the time constant
// as long as they only jitter.
class SourceTracker {
 public:
  explicit SourceTracker(double time_constant_s) : time_constant_s_(time_constant_s) {}

  // Gives known sources their former ids, nearest first, and new ones the next free ids, from 1.
  // Times must not go back.
  void follow(std::vector<Source>& sources, std::int64_t timestamp_ns);

  // Returns the sources of the last frame.
  std::span<const Source> known() const { return known_; }

 private:
  const double time_constant_s_;
  std::vector<Source> known_;
  std::int64_t last_ns_ = 0;
  int last_id_ = 0;
};

}  // namespace previz::lighting
