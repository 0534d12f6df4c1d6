// Looks for tags in the pictures of a walk.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/tracking/tag_detector.hpp"
#include "daemon/tools/calibrate/lens/source.hpp"
#include "daemon/tools/calibrate/tags/tag_bundle.hpp"

namespace previz::calibrate {

// The sizes of tags, as a command line gives them.
struct TagSizes {
  std::optional<double> common_m;  // of all that are not listed
  std::map<int, double> by_id_m;

  std::optional<double> of(int id) const;
};

// Reads "80mm", "7:120mm,8:0.12m" or "80mm,7:120mm"; throws previz::Error with the part that cannot
// be understood.
TagSizes parse_tag_sizes(const std::string& text);

struct WalkOptions {
  tracking::DetectorSettings detector;
  TagSizes sizes;
  std::vector<int> left_out;  // ids that are not fixed in the world: those of carriers
  // Uses every n-th picture; 0: all of a folder, at most about 150 of a session or a video.
  int every = 0;
};

// Returns the tags that can be measured in the pictures; a tag that is in one picture twice is left
// out of that picture, and named. `report` gets lines for the reader of the result. Throws
// previz::Error if the pictures are not of the lens's size, if the size of a seen tag is not known,
// and if no picture shows a tag, with what they show instead.
TagWalk gather_walk(PictureSource& source, const PinholeIntrinsics& lens,
                    const ResponseCurve& response, const WalkOptions& options,
                    const std::function<void(const std::string&)>& report);

}  // namespace previz::calibrate
