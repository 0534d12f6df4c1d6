// Draws lines and words over a picture as tiles to lay over a screen.
#pragma once

#include <filesystem>
#include <vector>

#include "daemon/core/output/font.hpp"
#include "daemon/core/output/guide_page.hpp"
#include "drivers/display.hpp"

namespace previz::output {

class GuidePainter {
 public:
  // The screen's size is in pixels. Lines are 2 px wide at a height of 1080, with a dark border, so
  // that they are seen on any picture. Throws previz::Error naming the font if it cannot be read.
  GuidePainter(int screen_width, int screen_height, DisplayScale scale,
               const std::filesystem::path& font = default_font());

  // Returns tiles of the screen that do not overlap, as few as have something on them. The shown
  // picture has this size, in pixels, and lies where the scale puts it; nothing is drawn beside it.
  std::vector<Overlay> paint(const GuidePage& page, int picture_width, int picture_height) const;

 private:
  const int width_, height_;
  const DisplayScale scale_;
  const Font font_;
};

}  // namespace previz::output
