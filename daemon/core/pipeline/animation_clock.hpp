// Measures how far the animations have been played, by the times of the frames.
#pragma once

#include <cstdint>
#include <optional>

namespace previz::pipeline {

class AnimationClock {
 public:
  // Returns the animation time in seconds at a frame of this time. `plays` counts how often playing
  // was restarted; the first frame with a new count shows the beginning. While `held`, the
  // animation time stands still.
  double at(std::int64_t timestamp_ns, std::uint64_t plays, bool held) {
    if (!last_ns_ || plays != plays_)
      played_ns_ = 0;
    else if (!held && timestamp_ns > *last_ns_)
      played_ns_ += timestamp_ns - *last_ns_;
    last_ns_ = timestamp_ns;
    plays_ = plays;
    return 1e-9 * static_cast<double>(played_ns_);
  }

 private:
  std::optional<std::int64_t> last_ns_;
  std::int64_t played_ns_ = 0;
  std::uint64_t plays_ = 0;
};

}  // namespace previz::pipeline
