// Gives the pixels of an environment's picture that hold no radiance one that light can be made of.
#pragma once

#include <functional>

#include "daemon/core/lighting/linear_picture.hpp"

namespace previz::lighting {

// Radiance above this is taken as an overflow, like +Inf. The disc of the sun has 1.6e9 cd/m^2; a
// thousand times that still leaves room for squares and sums of it in single precision (3.4e38).
inline constexpr float most_radiance = 1e12f;
// The largest half float, which is where most files with +Inf have overflowed.
inline constexpr float largest_half = 65504;

// Which pixels of the picture are looked at.
struct PictureShape {
  bool wraps = false;  // the left edge joins the right one
  std::function<bool(int x, int y)> uses;
};

// Replaces values of a channel: +Inf and what is above most_radiance by the largest other value of
// the picture, at least largest_half, because files that were converted to floats have overflowed
// as halves; NaN and -Inf by the median of the others in the 3x3 pixels around; and negative ones
// by the least of these, because they are the overshoot of a filter beside a lamp, or a colour that
// is out of gamut over an area, into which no light may come from its border. Where there is no
// other pixel around, holes are filled from the border inwards. What was replaced is counted in
// `notes` with the place of the first. Throws previz::Error naming the file if a channel has
// nothing but such values.
void repair(LinearPicture& picture, const PictureShape& shape, const std::filesystem::path& path,
            std::vector<std::string>& notes);

}  // namespace previz::lighting
