// Checks an OpenEXR file before the library reads it.
#pragma once

#include <filesystem>

namespace previz::lighting {

// Walks the attributes of a file's first header (OpenEXR's "File Layout"). Throws previz::Error
// naming the file where one claims more bytes than the file or its own value has, or fewer than its
// value, or the picture too many pixels (check_size()). What else is wrong is left to OpenEXR.
void check_exr_header(const std::filesystem::path& path);

}  // namespace previz::lighting
