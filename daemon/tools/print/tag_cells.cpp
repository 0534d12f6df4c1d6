#include "daemon/tools/print/tag_cells.hpp"

#include <apriltag/apriltag.h>

#include "daemon/core/tracking/tag_family.hpp"

namespace previz::print {

FamilyShape family_shape(const std::string& family) {
  const tracking::TagFamily made = tracking::make_tag_family(family);
  return {made->total_width, made->width_at_border, int(made->ncodes)};
}

void add_tag_cells(const std::string& family, int id, double x, double y, double cell,
                   Drawing& drawing) {
  const tracking::TagCells cells = tracking::tag_cells(family, id);
  for (int row = 0; row < cells.total; ++row)
    for (int column = 0; column < cells.total; ++column) {
      if (!cells.black(row, column)) continue;
      int end = column;  // neighbours in a row are one rectangle
      while (end < cells.total && cells.black(row, end)) ++end;
      drawing.black.push_back({x + column * cell, y + row * cell, (end - column) * cell, cell});
      column = end;
    }
}

}  // namespace previz::print
