// Makes textures smaller where a scene has more of them than fit.
#pragma once

#include <cstdint>
#include <vector>

#include "daemon/core/scene/picture_bytes.hpp"

namespace previz::scene {

// Returns the sizes of textures after the largest, of equal ones the last, was halved again and
// again until all have at most `most_texels` together. With `has_levels` a texture counts with all
// its levels (daemon/core/render/world/mip_levels.hpp).
std::vector<PictureSize> fitted_sizes(std::vector<PictureSize> sizes, bool has_levels,
                                      std::uint64_t most_texels);

}  // namespace previz::scene
