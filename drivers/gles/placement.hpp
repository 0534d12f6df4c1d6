// Computes where a picture goes on a screen.
#pragma once

#include "drivers/display.hpp"

namespace previz::gles {

// A rectangle in pixels of the screen, from its upper left corner; with 1:1 it may reach beyond the
// screen.
struct Rectangle {
  int x = 0, y = 0, width = 0, height = 0;

  friend bool operator==(const Rectangle&, const Rectangle&) = default;
};

// Sizes are pixels, at least 1. letterbox keeps the picture's shape and makes it as large as fits,
// rounded to whole pixels; the borders are equal, or one pixel wider on the right and below.
// one_to_one has the same borders, which are negative if the picture is larger than the screen.
Rectangle place(int picture_width, int picture_height, int screen_width, int screen_height,
                DisplayScale scale);

}  // namespace previz::gles
