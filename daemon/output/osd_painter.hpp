// Draws the overlay's words as boxes to lay over a screen's picture.
#pragma once

#include <filesystem>
#include <vector>

#include "daemon/output/font.hpp"
#include "daemon/output/osd_page.hpp"
#include "drivers/display.hpp"

namespace previz::output {

class OsdPainter {
 public:
  // The screen's size is in pixels; `text_height` is the em over the screen's height. Throws
  // previz::Error naming the font if it cannot be read.
  OsdPainter(int screen_width, int screen_height, double text_height,
             const std::filesystem::path& font = default_font());

  // Returns boxes within the screen that do not overlap. Boxes that do not fit beside each other go
  // to further rows; text that is too long for a row is broken. If rows run out, the column has
  // those that the notices leave; the last line of each says how many are hidden, and the permanent
  // texts lose their lower rows.
  std::vector<Overlay> paint(const OsdPage& page) const;

 private:
  struct Box {
    int x = 0, y = 0;
    OsdText words;
    int width = 0;
  };
  using Rows = std::vector<std::vector<Box>>;

  int width_of(const OsdText& words) const;
  bool fits(const std::string& text) const;  // true: fits in one row
  std::vector<OsdText> broken(const OsdText& words) const;
  Rows rows_of(const std::vector<OsdText>& left, const std::vector<OsdText>& right) const;
  std::vector<OsdText> stacked(const std::vector<OsdText>& texts, std::size_t most,
                               const OsdText& hidden) const;
  Rows notices(const std::vector<OsdText>& notices, std::size_t most) const;
  Rows column(const std::vector<OsdText>& texts, std::size_t most) const;
  Overlay draw(const Box& box) const;

  const int width_, height_;
  const Font font_;
  const int padding_, gap_, margin_, box_height_;  // pixels
};

}  // namespace previz::output
