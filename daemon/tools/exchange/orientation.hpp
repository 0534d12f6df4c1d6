// Puts pictures upright, and makes their pixels square.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "daemon/tools/exchange/footage.hpp"

namespace previz::exchange {

// How a picture must be turned to be upright. A pixel x to the right of the middle and y below it
// goes to
//   x' = xx x + xy y,  y' = yx x + yy y;
// each factor is 0, 1 or -1, and two of them are 0. There are eight orientations.
struct Orientation {
  int xx = 1, xy = 0, yx = 0, yy = 1;

  Orientation inverse() const { return {xx, yx, xy, yy}; }
  bool is_upright() const { return *this == Orientation{}; }
  // "turned by 90 degrees clockwise", "mirrored left to right", ...
  std::string words() const;

  friend bool operator==(const Orientation&, const Orientation&) = default;
};

// The Orientation of EXIF's tag 0x0112, 1 to 8; nothing for another number.
std::optional<Orientation> exif_orientation(int number);
// The orientation of libav's display matrix: nine numbers, 16.16 fixed point. Nothing where it
// turns by another angle or shears. It may scale.
std::optional<Orientation> display_orientation(const std::array<std::int32_t, 9>& matrix);

// Turns a picture of grey or RGB.
void turn(Picture& picture, const Orientation& orientation);

// Stretches a picture of grey or RGB in width or height, by cubic interpolation, so that pixels of
// the shape `wide` to `high` become square. It is never made smaller.
void make_square(Picture& picture, int wide, int high);

}  // namespace previz::exchange
