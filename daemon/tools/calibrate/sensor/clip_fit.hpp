// Measures from which code on a camera clips, in a bracket of exposures.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>

#include "daemon/tools/calibrate/sensor/brackets.hpp"
#include "drivers/calibration.hpp"

namespace previz::calibrate {

// Says what one channel shows of pixels that get so much light that the camera must clip it.
struct ClippedChannel {
  std::size_t samples = 0;   // pixels times exposures, surely clipped; enough if any
  int usual = 0;             // the median of their codes (of 255)
  int lowest = 0;            // nineteen of twenty have this code or a higher one
  double stops_further = 0;  // from where the codes stop rising to the most light of a sample
};

struct ClipFit {
  std::array<ClippedChannel, 3> channels;  // red, green, blue
  int brightest = 0;                       // the highest code in the bracket
  // Returns the lowest code that counts as clipped; nothing if no channel shows it. It is the
  // lowest of the channels, since a set file has one threshold for the three: counting a channel's
  // last codes as clipped too early costs less than taking "at least white" for a measurement.
  std::optional<int> code() const;
  // Returns the set file's clip_share, for pictures of any depth: ResponseCurve::clip_share.
  std::optional<double> share() const;
};

// A sample, which is one channel of a pixel in one exposure, is surely clipped if it gets at least
// a stop more light than where the codes stop rising. How much light it gets follows from the
// pixel's code in the last exposure that shows it below the middle code, by the curve; only the
// curve below the middle code matters, since clip_share is at least 0.5. Where the codes stop
// rising follows from the pictures and not from the curve: from there on, the median code of each
// quarter of a stop of light is within a code of that of all brighter samples.
// A shoulder that still rises by more is therefore light. Not counted are the edges of bright
// areas, where a pixel is a mixture of clipped and dark light, what is dark although it was bright
// at less exposure (something moved), and channels with less than 100 such samples. `bracket` is as
// read_bracket returns it.
ClipFit fit_clip(std::span<const BracketPicture> bracket, const ResponseCurve& curve);

// Returns in plain words, in lines, what was measured and by what evidence, or which picture would
// show it.
std::string describe(const ClipFit& fit);

}  // namespace previz::calibrate
