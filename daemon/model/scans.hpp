// The scans among the parts: read, simplified, and placed by their marked points or by the set's
// tags.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "daemon/model/scan_mesh.hpp"
#include "daemon/model/scan_read.hpp"
#include "daemon/model/start.hpp"

namespace previz::model {

// Reads the scans' files, in the order of the parts, with the colours of those without points.
// Throws previz::Error naming the file that is not a mesh, the texture that cannot be read, or the
// point whose coordinates are not on the scan's surface.
std::vector<ScanFile> read_scans(const Parts& parts);

// Places the scans on the adjusted points of the shape, or, where they have none, on the tags that
// their colours show and that are fixed in the world; and reports on `out` how well each fits and
// what is wrong with its surface. Throws previz::Error naming the scan and what is at fault: see
// place_scan and find_scan_tags; or the key that neither the table nor the file gives, with its
// likely value.
std::vector<NamedMesh> place_scans(const Parts& parts, const Layout& layout, const Shape& shape,
                                   const std::vector<ScanFile>& files,
                                   const set::Tracking& tracking, std::ostream& out);

}  // namespace previz::model
