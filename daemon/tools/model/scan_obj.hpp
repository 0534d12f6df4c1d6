// Reads scans in OBJ with their MTL (Wavefront 1995, "Object Files", "MTL material format").
#pragma once

#include <string>

#include "daemon/tools/model/scan_colours.hpp"
#include "daemon/tools/model/scan_surface.hpp"

namespace previz::model {

// Reads vertices, with colours where they have any, texture coordinates and faces; normals, groups,
// lines and curves are skipped. `textures` gets those that the materials name (map_Kd, else
// map_Ke); null: no colours are read. Throws previz::Error naming the file, and what is wrong
// with it.
FoundSurface read_obj(const std::filesystem::path& file, std::string&& bytes,
                      ScanTextures* textures);

}  // namespace previz::model
