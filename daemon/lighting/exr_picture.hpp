// Reads linear RGB pictures from OpenEXR files, which are environments.
#pragma once

#include "daemon/lighting/linear_picture.hpp"

namespace previz::lighting {

// Reads R, G and B, or Y, of half, float or integer samples; other channels are ignored. Oddities
// that do not prevent its use are appended to `notes`. Throws previz::Error naming the file and,
// if channels are missing, those that it has; a picture of more than most_pixels is refused before
// memory is asked for.
LinearPicture read_exr_picture(const std::filesystem::path& path, std::vector<std::string>& notes);

}  // namespace previz::lighting
