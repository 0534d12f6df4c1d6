// Draws a model over the pictures in which it was marked, so that a person sees how it fits.
#pragma once

#include <filesystem>

#include "daemon/tools/model/solids.hpp"
#include "daemon/tools/model/views.hpp"

namespace previz::model {

// Writes NAME.model.png for each marked picture into a folder, which is created: the edges of the
// solids that they do not hide in green, the marks as red crosses. Throws previz::Error naming a
// file that cannot be written.
void write_overlays(const Views& views, const Shape& shape, const std::vector<Solid>& solids,
                    const std::filesystem::path& folder);

}  // namespace previz::model
