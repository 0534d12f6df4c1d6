// Makes libapriltag's families of tags by their names.
#pragma once

#include <memory>
#include <string>
#include <vector>

struct apriltag_family;  // libapriltag's: its cells and codes

namespace previz::tracking {

using TagFamily = std::unique_ptr<apriltag_family, void (*)(apriltag_family*)>;

// Returns a family of its own. Throws previz::Error that begins with `where` and names the families
// if `name` is none of set::tag_families.
TagFamily make_tag_family(const std::string& name, const std::string& where = "");

// How a tag is printed.
struct TagCells {
  int total = 0;               // cells across all of it, with what it has outside of its border
  int border = 0;              // cells across the border, whose outer edges are the tag's size
  std::vector<bool> is_black;  // total x total, row by row from the upper left

  bool black(int row, int column) const { return is_black[std::size_t(row * total + column)]; }
};

// Returns libapriltag's own picture of the tag. Throws previz::Error naming the families if
// `family` is none of them, and the ids that it has if `id` is none of them.
TagCells tag_cells(const std::string& family, int id);

}  // namespace previz::tracking
