// Converts the exposures of one scene to signals, and checks whether they can show the same light.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <map>
#include <span>
#include <vector>

#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"
#include "drivers/plate.hpp"

namespace previz::lighting {

// The noise model of a sensor: the variance of a signal s in [0, 1] is s * signal_per_electron +
// read_noise^2, besides rounding to codes. Only ratios between exposures depend on it. A signal of
// 1 is here the one that the sensor clips at (Codes::full).
struct SensorNoise {
  double signal_per_electron = 1.0 / 30000;
  double read_noise = 3e-4;  // standard deviation of the signal
  // The relative error that response curve and stated exposures may have: exposures that differ by
  // less still show the same light.
  double calibration_error = 0.15;
};

// The meaning of one channel's codes: the signal above the dark level, and the variance that
// rounding to the code leaves in it. The tables are the same for all frames of a bit depth.
struct Codes {
  std::vector<double> signal;
  std::vector<double> rounding_variance;
  std::size_t darkest = 0;  // the code that a covered lens shows
  double dark = 0;  // below this signal, rounding to the darkest code or its neighbour dominates
  std::uint32_t clipped_from = 0;  // this code and all above it are clipped
  double white = 1;                // its signal
  double full = 1;                 // the same without the dark level taken off

  bool clipped(std::uint16_t code) const { return code >= clipped_from; }
  bool black(std::uint16_t code) const { return code <= darkest; }
};

struct Exposure {
  Plate plate;
  double exposure = 0;
  std::uint64_t sequence = 0;
  const std::array<Codes, 3>* codes = nullptr;  // by channel
};

// The exposures of a bracket, newest first: by time, then by sequence number, then by the order
// given, the last being newest.
class Bracket {
 public:
  // Throws previz::Error naming the frame whose exposure or size cannot be used.
  Bracket(std::span<const FramePtr> frames, const ResponseCurve& response,
          const glm::dvec3& dark_level);
  Bracket(const Bracket&) = delete;
  Bracket& operator=(const Bracket&) = delete;

  int width() const { return exposures_.front().plate.width; }
  int height() const { return exposures_.front().plate.height; }
  std::int64_t newest_ns() const { return newest_ns_; }  // capture time of the newest
  const std::vector<Exposure>& exposures() const { return exposures_; }  // at least one

 private:
  std::map<int, std::array<Codes, 3>> codes_;  // by bit depth; exposures point into it
  std::vector<Exposure> exposures_;
  std::int64_t newest_ns_ = 0;
};

// Two exposures whose pictures differ by one factor everywhere. A wrong exposure causes that, or a
// light that is nearly all the light there is.
struct Disagreement {
  std::uint64_t shorter = 0, longer = 0;  // sequence numbers
  double stops = 0;                       // log2 of the shorter's radiance over the longer's
};

// Compares each exposure with the next longer one, over the pixels that both see well: neither near
// white nor within 10 standard deviations of the dark. Reports differences of half a stop or more
// that are significant against the scatter of single pixels.
std::vector<Disagreement> disagreements(const Bracket& bracket, const SensorNoise& noise = {});

}  // namespace previz::lighting
