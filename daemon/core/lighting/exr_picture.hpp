// Reads linear RGB pictures from OpenEXR files, which are environments.
#pragma once

#include "daemon/core/lighting/linear_picture.hpp"

namespace previz::lighting {

struct ExrReading {
  bool keeps_primaries = false;  // for a caller that knows what the numbers mean
  // A frame of footage, whose caller clips what is outside of 0 to 1, negative values too. It may
  // lack an eighth of its rows and columns, and notes are alike for frames of the same kind.
  bool is_plate = false;
  std::int64_t most_kept = most_kept_pixels;
};

// Reads R, G and B, CIE X, Y and Z, or Y, of half, float or integer samples, or the only layer that
// has R, G and B; other channels are ignored. The picture is the display window, black where the
// file has no pixels, and brought to linear Rec. 709 by what the file says (exr_color.hpp); colours
// of a light that it cannot show are at its edge (convert_light() in primaries.hpp).
// Oddities that do not prevent its use are appended to `notes`. Throws previz::Error naming the
// file and, if channels are missing, those that it has; a picture of more than most_pixels is
// refused before memory is asked for, and one of more than `most_kept` is made coarser.
LinearPicture read_exr_picture(const std::filesystem::path& path, std::vector<std::string>& notes,
                               const ExrReading& reading = {});

}  // namespace previz::lighting
