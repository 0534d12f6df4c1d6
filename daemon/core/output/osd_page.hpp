// The words of the overlay (on-screen display) by place, as plain data without pixels.
#pragma once

#include <string>
#include <vector>

namespace previz::output {

enum class OsdTone {
  plain,      // everything is as it should be
  mode,       // the rig is in an unusual mode
  recording,  // a take is being recorded
  warning,    // worth a look
  alarm       // something is broken or missing
};

// One box of text, UTF-8.
struct OsdText {
  std::string text;
  OsdTone tone = OsdTone::plain;

  friend bool operator==(const OsdText&, const OsdText&) = default;
};

// The boxes of each corner stand beside each other; under the upper corners, notices are
// stacked at the right and the lines of the column at the left, so that the middle stays free.
struct OsdPage {
  std::vector<OsdText> top_left, top_right, bottom_left, bottom_right, notices;
  std::vector<OsdText> column = {};

  friend bool operator==(const OsdPage&, const OsdPage&) = default;
};

}  // namespace previz::output
