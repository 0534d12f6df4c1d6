// Reads a picture of linear light from a file of either format that can hold one: OpenEXR or
// Radiance .hdr.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "daemon/core/lighting/linear_picture.hpp"

namespace previz::lighting {

// Reads the file by what it holds, whatever its name is. Oddities that do not prevent its use are
// appended to `notes`. Throws previz::Error naming the file and what is wrong with it; a file of
// another format is refused by the name of that format. A picture of more than `most_kept` pixels
// is made coarser.
LinearPicture read_linear_picture(const std::filesystem::path& path,
                                  std::vector<std::string>& notes,
                                  std::int64_t most_kept = most_kept_pixels);

}  // namespace previz::lighting
