// Puts pictures upright, and makes their pixels square.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "daemon/exchange/footage.hpp"

namespace previz::exchange {

// How a picture must be turned to be upright: to its place right and down of the middle,
//   x' = xx x + xy y,  y' = yx x + yy y,
// each 0, 1 or -1, two of them 0. There are eight.
struct Orientation {
  int xx = 1, xy = 0, yx = 0, yy = 1;

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

// Widens or heightens a picture of grey or RGB, by cubic interpolation, so that pixels `wide` to
// `high` become square. No sample is lost but those between.
void make_square(Picture& picture, int wide, int high);

}  // namespace previz::exchange
