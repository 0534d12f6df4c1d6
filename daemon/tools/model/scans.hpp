// The scans among the parts: read, simplified, and placed by their marked points or by the set's
// tags.
#pragma once

#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "daemon/tools/model/scan_mesh.hpp"
#include "daemon/tools/model/scan_read.hpp"
#include "daemon/tools/model/scan_tags.hpp"
#include "daemon/tools/model/start.hpp"

namespace previz::model {

// A scan as its file has it, without its colours.
struct ReadScan {
  ScanFile file;
  std::optional<ScanTags> tags;  // that its colours show, if it has no points
};

// Reads the scans' files, in the order of the parts. Looks for tags that are fixed in the world on
// those without points, and reports on `out` which are ignored. Throws previz::Error naming the
// file that is not a mesh, the texture that cannot be read, or the point whose coordinates are not
// on the scan's surface; see find_scan_tags.
std::vector<ReadScan> read_scans(const Parts& parts, const set::Tracking& tracking,
                                 std::ostream& out);

// Places the scans, in the order of the parts, on the adjusted points of the shape, or, where they
// have none, by their tags; and reports on `out` how well each fits and what is wrong with its
// surface. Throws previz::Error naming the scan and what is at fault: see place_scan; or the key
// that neither the table nor the file gives, with its likely value.
std::vector<NamedMesh> place_scans(const Parts& parts, const Layout& layout, const Shape& shape,
                                   const std::vector<ReadScan>& scans, std::ostream& out);

}  // namespace previz::model
