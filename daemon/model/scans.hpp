// The scans among the parts: read, simplified, and placed by their marked points.
#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "daemon/model/scan_mesh.hpp"
#include "daemon/model/scan_read.hpp"
#include "daemon/model/start.hpp"

namespace previz::model {

// Reads the scans' files, in the order of the parts. Throws previz::Error naming the file that is
// not a mesh, or the point whose coordinates are not on the scan's surface.
std::vector<ScanFile> read_scans(const Parts& parts);

// Places the scans on the adjusted points of the shape, and reports on `out` how well each fits and
// what is wrong with its surface. Throws previz::Error naming the scan and what is at fault: see
// place_scan; or the key that neither the table nor the file gives, with its likely value.
std::vector<NamedMesh> place_scans(const Parts& parts, const Layout& layout, const Shape& shape,
                                   const std::vector<ScanFile>& files, std::ostream& out);

}  // namespace previz::model
