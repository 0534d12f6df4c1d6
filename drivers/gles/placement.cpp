#include "drivers/gles/placement.hpp"

#include <algorithm>
#include <cstdint>

namespace previz::gles {
namespace {

// Returns a * b / c, rounded to nearest, at least 1.
int in_proportion(int a, int b, int c) {
  const std::int64_t product = std::int64_t{a} * b;
  return static_cast<int>(std::max<std::int64_t>((2 * product + c) / (2 * std::int64_t{c}), 1));
}

// Returns half of what is left, rounded towards the upper left.
int border(int screen, int picture) {
  const int left = screen - picture;
  return left >= 0 ? left / 2 : -((1 - left) / 2);
}

}  // namespace

Rectangle place(int picture_width, int picture_height, int screen_width, int screen_height,
                DisplayScale scale) {
  int width = picture_width;
  int height = picture_height;
  if (scale == DisplayScale::letterbox) {
    const bool full_width =
        std::int64_t{picture_width} * screen_height >= std::int64_t{picture_height} * screen_width;
    width = full_width ? screen_width : in_proportion(picture_width, screen_height, picture_height);
    height =
        full_width ? in_proportion(picture_height, screen_width, picture_width) : screen_height;
  }
  return {border(screen_width, width), border(screen_height, height), width, height};
}

}  // namespace previz::gles
