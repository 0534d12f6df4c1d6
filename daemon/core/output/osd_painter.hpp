// Draws the overlay's words as boxes to lay over a screen's picture.
#pragma once

#include <filesystem>
#include <vector>

#include "daemon/core/output/font.hpp"
#include "daemon/core/output/osd_page.hpp"
#include "drivers/display.hpp"

namespace previz::output {

class OsdPainter {
 public:
  // The screen's size is in pixels; `text_height` is the em over the screen's height. Throws
  // previz::Error naming the font if it cannot be read.
  OsdPainter(int screen_width, int screen_height, double text_height,
             const std::filesystem::path& font = default_font());

  // Returns boxes within the screen that do not overlap. Boxes that do not fit beside each other go
  // to further rows; text that is too long for a row is broken. Notices take the right third of the
  // screen, or more where the words are large for that; the column is then left out. If rows run
  // out, the last line of each says how many are hidden, and the permanent texts lose their lower
  // rows.
  std::vector<Overlay> paint(const OsdPage& page) const;

 private:
  struct Box {
    int x = 0, y = 0;
    OsdText words;
    int width = 0;
  };
  using Rows = std::vector<std::vector<Box>>;

  int width_of(const OsdText& words) const;
  std::vector<OsdText> broken(const OsdText& words, int most_width) const;
  Rows rows_of(const std::vector<OsdText>& left, const std::vector<OsdText>& right) const;
  std::vector<OsdText> stacked(const std::vector<OsdText>& texts, int most_width, std::size_t most,
                               const OsdText& hidden) const;
  Rows notices(const std::vector<OsdText>& notices, std::size_t most) const;
  Rows column(const std::vector<OsdText>& texts, bool is_alone, std::size_t most) const;
  Overlay draw(const Box& box) const;

  const int width_, height_;
  const Font font_;
  const int padding_, gap_, margin_, box_height_;  // pixels
  const int row_width_, side_width_;  // likewise; a notice is at most as wide as a side
};

}  // namespace previz::output
