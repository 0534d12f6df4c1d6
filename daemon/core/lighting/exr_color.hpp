// Finds out which linear light the values of an OpenEXR file are.
#pragma once

#include <ImfHeader.h>

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/lighting/primaries.hpp"

namespace previz::lighting {

// What the three channels that are read are by their names.
enum class ExrChannels { rgb, xyz, luminance };

// Returns the matrix that brings the file's values to linear Rec. 709; nothing where they are that
// already. Of the attributes that name a colour space the first of these counts: colorInteropID
// (Color Interop Forum), acesImageContainerFlag (SMPTE ST 2065-4), oiio:ColorSpace, chromaticities.
// OpenImageIO writes an oiio:ColorSpace of linear Rec. 709 into files that say nothing of it, so
// that chromaticities come before one of Rec. 709. What is converted, and attributes that disagree,
// are appended to `notes`. Throws previz::Error naming the file for values that are data, under a
// curve, or of a space that is not known, with the command that converts them.
std::optional<ColorMatrix> rec709_from(const Imf::Header& header, ExrChannels channels,
                                       const std::filesystem::path& path,
                                       std::vector<std::string>& notes);

}  // namespace previz::lighting
