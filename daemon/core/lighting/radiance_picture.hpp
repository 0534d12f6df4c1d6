// Reads Radiance .hdr pictures, four bytes a pixel with a common exponent (Ward 1991, "Real
// Pixels", Graphics Gems II; the format's file is Radiance's "filefmts").
#pragma once

#include "daemon/core/lighting/linear_picture.hpp"

namespace previz::lighting {

// Reads flat pixels and both kinds of run lengths, turns the picture upright, and divides by
// EXPOSURE and COLORCORR where the header has them, which is noted. A mantissa m with exponent e is
// m 2^(e - 136), as OpenCV, OpenImageIO and Blender have it. Other PRIMARIES than those of Rec.
// 709, and CIE XYZ, are converted, which is noted. Throws previz::Error naming the file and, where
// it is damaged, the scan line; a picture of more than most_pixels is refused before memory is
// asked for, and one of more than `most_kept` is made coarser.
LinearPicture read_radiance_picture(const std::filesystem::path& path,
                                    std::vector<std::string>& notes,
                                    std::int64_t most_kept = most_kept_pixels);

}  // namespace previz::lighting
