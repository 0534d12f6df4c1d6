// Reads scans in STL (3D Systems 1989), text and binary.
#pragma once

#include <filesystem>
#include <string_view>

#include "daemon/tools/model/scan_surface.hpp"

namespace previz::model {

// Reads the facets of all solids. A binary file may begin with "solid", too. Throws previz::Error
// naming the file if it is cut short or is neither.
FoundSurface read_stl(const std::filesystem::path& file, std::string_view bytes);

}  // namespace previz::model
