// Reads the file of a scan.
#pragma once

#include <filesystem>

#include "daemon/tools/model/scan_file.hpp"

namespace previz::model {

// Reads OBJ, PLY, STL, FBX or glTF; all its meshes, placed by its nodes. glTF is in metres, Y up;
// FBX gives its unit and axis. Throws previz::Error naming the file: it is of another kind, it
// cannot be read, it has no triangles, or a coordinate in it is not a number; or the texture that
// cannot be read, if colours are.
ScanFile read_scan(const std::filesystem::path& file, Colouring colouring = Colouring::ignored);

}  // namespace previz::model
