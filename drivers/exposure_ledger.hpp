// Works out which exposure applied to which frame of a device that does not report it.
#pragma once

#include <cmath>
#include <cstdint>
#include <deque>
#include <optional>

#include "drivers/frame.hpp"

namespace previz {

struct Exposure {
  double exposure_s = 0;  // shutter time; 0 where unknown
  double gain = 1;        // linear sensor gain

  friend bool operator==(const Exposure&, const Exposure&) = default;
};

// Returns whether radiance can be divided by an exposure.
inline bool is_exposure(double exposure_s, double gain) {
  return exposure_s > 0 && gain > 0 && std::isnormal(exposure_s * gain);
}

// A device applies a new exposure somewhere between the frame it is capturing when it is asked and
// a few frames later. Earlier frames have the old exposure, later ones the new. In between nobody
// knows, and a bracket with a wrong label would be worse than a missing frame.
class ExposureLedger {
 public:
  // `settle_frames` is how many frames begun after a change may still have the old exposure.
  ExposureLedger(const Exposure& initial, int settle_frames)
      : current_(initial), settle_frames_(settle_frames) {}

  // Records that the device was asked for `exposure` between these two times (host clock).
  void changed(std::int64_t before_ns, std::int64_t after_ns, const Exposure& exposure) {
    changes_.push_back({before_ns, after_ns, exposure, settle_frames_});
  }

  // Returns the exposure of the frame with this time stamp; none if it is not known. Must be called
  // once a frame, in order.
  std::optional<Exposure> of_frame(std::int64_t timestamp_ns) {
    while (!changes_.empty() && timestamp_ns > changes_.front().after_ns) {
      Change& change = changes_.front();
      const bool superseded = changes_.size() > 1 && timestamp_ns > changes_[1].after_ns;
      if (!superseded && change.unsettled-- > 0) return std::nullopt;
      current_ = change.exposure;
      changes_.pop_front();
    }
    if (!changes_.empty() && timestamp_ns >= changes_.front().before_ns) return std::nullopt;
    return current_;
  }

  // Does the same for a frame that may itself say what it was taken with, which counts if radiance
  // can be divided by it; where it says nothing of the gain, that of the ledger holds.
  std::optional<Exposure> of_frame(std::int64_t timestamp_ns, std::optional<double> said_s,
                                   std::optional<double> said_gain) {
    const std::optional<Exposure> by_time = of_frame(timestamp_ns);
    const double gain = said_gain.value_or(by_time ? by_time->gain : 0);
    if (!said_s || !is_exposure(*said_s, gain)) return by_time;
    return Exposure{*said_s, gain};
  }

 private:
  struct Change {
    std::int64_t before_ns, after_ns;
    Exposure exposure;
    int unsettled;
  };

  Exposure current_;
  int settle_frames_;
  std::deque<Change> changes_;
};

// Writes the exposure that a frame was taken with into the frame. A shutter time that is not known
// (0) counts as 1 s.
inline void apply_exposure(Frame& frame, const Exposure& exposure, double responsivity) {
  frame.exposure_s = exposure.exposure_s;
  frame.gain = exposure.gain;
  frame.exposure =
      (exposure.exposure_s > 0 ? exposure.exposure_s : 1.0) * exposure.gain * responsivity;
}

}  // namespace previz
