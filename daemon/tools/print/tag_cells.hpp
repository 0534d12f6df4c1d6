// Draws tags as cells, by libapriltag's own tables.
#pragma once

#include <string>

#include "daemon/tools/print/drawing.hpp"

namespace previz::print {

// How a family's tags look.
struct FamilyShape {
  int total = 0;   // cells across all of it, with what it has outside of its border
  int border = 0;  // cells across the border, whose outer edges are the tag's size
  int count = 0;   // ids are below this
};

// These throw previz::Error naming the families if `family` is none of them, and the ids that it
// has if `id` is none of them.
FamilyShape family_shape(const std::string& family);
// Adds the tag's black cells with the upper left corner of its `total` cells at (x, y); `cell` is
// the side of a cell, mm.
void add_tag_cells(const std::string& family, int id, double x, double y, double cell,
                   Drawing& drawing);

}  // namespace previz::print
