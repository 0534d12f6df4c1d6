// What the overlay (on-screen display) says: words by place, without pixels. Plain data.
#pragma once

#include <string>
#include <vector>

namespace previz::output {

enum class OsdTone {
  plain,      // what is as it should be
  mode,       // what the rig does, where that is not the ordinary
  recording,  // a take runs
  warning,    // worth a look
  alarm       // something is broken or missing
};

// One box of text, UTF-8.
struct OsdText {
  std::string text;
  OsdTone tone = OsdTone::plain;

  friend bool operator==(const OsdText&, const OsdText&) = default;
};

// Boxes beside each other in the corners; notices in the middle below, one above the other.
struct OsdPage {
  std::vector<OsdText> top_left, top_right, bottom_left, bottom_right, notices;

  friend bool operator==(const OsdPage&, const OsdPage&) = default;
};

}  // namespace previz::output
