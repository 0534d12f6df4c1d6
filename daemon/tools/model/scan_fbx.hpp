// Reads scans in FBX, with Assimp, in a process of its own.
#pragma once

#include <filesystem>

#include "daemon/tools/model/scan_colours.hpp"
#include "daemon/tools/model/scan_surface.hpp"

namespace previz::model {

// Reads all meshes, placed by their nodes; `file` gets the unit and the axis that the FBX gives.
// Null for `textures`: no colours are read. Throws previz::Error naming the file if it cannot be
// read, and the texture that is moved, turned or scaled on its faces.
FoundSurface read_fbx(const std::filesystem::path& path, ScanTextures* textures, ScanFile& file);

}  // namespace previz::model
