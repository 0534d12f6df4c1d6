// Reads scans in glTF, with the reader of objects.
#pragma once

#include <filesystem>

#include "daemon/tools/model/scan_colours.hpp"
#include "daemon/tools/model/scan_surface.hpp"

namespace previz::model {

// Reads the meshes of the file's scene, placed by their nodes and copied as these say; skins and
// morph targets are at rest. `file` gets unit and axis, metres and Y up, and notes about what is
// left out. Null for `textures`: no colours are read. Throws previz::Error naming the file, and
// what is wrong with it.
FoundSurface read_gltf_scan(const std::filesystem::path& path, ScanTextures* textures,
                            ScanFile& file);

}  // namespace previz::model
