// Averages what the passes of the graphics card take over the last second, for the overlay.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "daemon/core/render/device/gpu.hpp"

namespace previz::live {

// Holds what the graphics card did for a frame, on average over the last second.
struct PassTimes {
  struct Pass {
    std::string name;
    double ms;  // of all its runs for a frame, by the card's own clock
  };
  bool is_timed = false;      // false: the device does not time its passes, and the rest is empty
  bool is_of_rounds = false;  // the times are of a refinement's rounds instead of frames
  std::vector<Pass> passes;   // the longest first
  double waited_ms = 0;       // of the computer, for the card
  double untimed = 0;         // passes that could not be timed
};

class PassMeter {
 public:
  // Adds what take_times() has returned for a frame, or for a round of a refinement, that was
  // rendered until now (monotonic). Frames and rounds are not averaged with each other. Returns
  // true if the reading is another one: at first, and then twice a second, because nobody can read
  // figures that change with every frame.
  bool add(std::int64_t now_ns, render::DeviceTimes times, bool is_round);
  const PassTimes& read() const { return reading_; }

 private:
  struct Entry {
    std::int64_t at_ns;
    render::DeviceTimes times;
  };
  void read_off();
  PassTimes::Pass& pass_named(const std::string& name);

  std::deque<Entry> recent_;  // of the last second, at least one
  std::int64_t next_ns_ = 0;  // when the next reading is due
  PassTimes reading_;
};

}  // namespace previz::live
