// Finds tags that did not stay in one place while the camera walked.
#pragma once

#include <optional>
#include <string>

#include "daemon/tools/calibrate/tags/tag_bundle.hpp"

namespace previz::calibrate {

// A tag that lies elsewhere in some pictures than in the others.
struct MovedTag {
  int id = 0;
  // The last picture of its first place and the first one of its second; empty: no two places
  // explain what was seen.
  std::string until, since;
  double distance_m = 0, angle_rad = 0;  // between the two places
  double off_px = 0;                     // how far off its corners are where they are worst
};

// Returns the tag whose sightings are explained worst by one place, if there is one whose corners
// moved by more than sighting_gate_px(): between two places, or without order. The cameras are
// taken as they are.
std::optional<MovedTag> most_moved_tag(const TagWalk& walk, const PinholeIntrinsics& lens,
                                       const TagPlaces& places, double model_error_px);

// "moved by 10.2 mm and 0.3 degrees between a.png and b.png"
std::string words_of(const MovedTag& moved);

}  // namespace previz::calibrate
