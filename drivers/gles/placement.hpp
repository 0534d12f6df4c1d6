// Where a picture goes on a screen.
#pragma once

#include "drivers/display.hpp"

namespace previz::gles {

// Pixels of the screen, from its upper left corner; may reach beyond it (1:1).
struct Rectangle {
  int x = 0, y = 0, width = 0, height = 0;

  friend bool operator==(const Rectangle&, const Rectangle&) = default;
};

// Sizes are pixels, at least 1. letterbox: the picture's shape, as large as fits, rounded to whole
// pixels, the borders equal or one pixel wider right and below. one_to_one: the same borders, which
// are negative where the picture is larger.
Rectangle place(int picture_width, int picture_height, int screen_width, int screen_height,
                DisplayScale scale);

}  // namespace previz::gles
