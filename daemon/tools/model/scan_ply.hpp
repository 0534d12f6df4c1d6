// Reads scans in PLY (Turk 1994, "The PLY Polygon File Format"), text and binary.
#pragma once

#include <string>

#include "daemon/tools/model/scan_colours.hpp"
#include "daemon/tools/model/scan_surface.hpp"

namespace previz::model {

// Reads vertices, faces and triangle strips, with colours of vertices by any of the names that
// programs use, and texture coordinates of vertices or of each face's corners; other elements are
// skipped. `textures` gets the files that the header names; null: no colours are read. Throws
// previz::Error naming the file, and what is wrong with it.
FoundSurface read_ply(const std::filesystem::path& file, std::string&& bytes,
                      ScanTextures* textures);

}  // namespace previz::model
