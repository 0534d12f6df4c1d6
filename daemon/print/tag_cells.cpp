#include "daemon/print/tag_cells.hpp"

#include <apriltag/apriltag.h>

#include <cstdlib>

#include "daemon/tracking/tag_family.hpp"
#include "drivers/error.hpp"

namespace previz::print {

FamilyShape family_shape(const std::string& family) {
  const tracking::TagFamily made = tracking::make_tag_family(family);
  return {made->total_width, made->width_at_border, int(made->ncodes)};
}

void add_tag_cells(const std::string& family, int id, double x, double y, double cell,
                   Drawing& drawing) {
  const tracking::TagFamily made = tracking::make_tag_family(family);
  if (id < 0 || id >= int(made->ncodes))
    throw Error(family + " has no id " + std::to_string(id) + "; it has 0 to " +
                std::to_string(made->ncodes - 1));
  image_u8_t* image = apriltag_to_image(made.get(), std::uint32_t(id));
  for (int row = 0; row < made->total_width; ++row)
    for (int column = 0; column < made->total_width; ++column) {
      const auto black = [&](int at) { return image->buf[row * image->stride + at] == 0; };
      if (!black(column)) continue;
      int end = column;  // neighbours in a row are one rectangle
      while (end < made->total_width && black(end)) ++end;
      drawing.black.push_back({x + column * cell, y + row * cell, (end - column) * cell, cell});
      column = end;
    }
  std::free(image->buf);  // the packaged library does not export image_u8_destroy
  std::free(image);
}

}  // namespace previz::print
