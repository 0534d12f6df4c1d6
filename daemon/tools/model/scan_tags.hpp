// Finds the set's tags in the colours of a scan.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "daemon/core/set/set.hpp"
#include "daemon/tools/model/scan_place.hpp"
#include "daemon/tools/model/scan_read.hpp"

namespace previz::model {

struct ScanTags {
  std::vector<PointPair> corners;  // four of each tag
  std::vector<int> ids;            // of these tags
  std::vector<std::string> notes;  // why other tags are ignored
  double grain = 0;                // size of the colours' pixels on the surface, the scan's unit
};

// Draws the scan from many directions, as its textures may have a tag in pieces, and looks for tags
// in these pictures; each one found is measured again from the front and from four places around
// it. Only tags that are fixed in the world count. `unit_m` is the scan's, where it is known.
// Throws previz::Error, "SUBJECT: ...", if no tag can be used: the scan has no colours, shows no
// tag, tags of other sets only, or mirrored ones.
ScanTags find_scan_tags(const std::string& subject, const ScanFile& scan,
                        const set::Tracking& tracking, std::optional<double> unit_m);

}  // namespace previz::model
