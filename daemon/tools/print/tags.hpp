// Draws tags to be cut out, and tags around a cube or a square stick.
#pragma once

#include <string>
#include <vector>

#include "daemon/tools/print/drawing.hpp"

namespace previz::print {

// Reads "0-11,20"; throws previz::Error with the part that cannot be understood.
std::vector<int> parse_ids(const std::string& text);

struct TagSheet {
  std::string family = "tag36h11";
  std::vector<int> ids;
  double size_mm = 0;  // outer edge of the border
};

// A drawing a tag, with a white margin of one cell and its name below.
std::vector<Drawing> draw_tags(const TagSheet& sheet);

// The net of a cube with a tag on each side: around it the first four, then the upper side, then
// the lower one (which five ids leave white). Folds are dashed. Throws previz::Error for another
// number of ids.
Drawing draw_block(const TagSheet& sheet);

// Paper that is wrapped around a square stick: four tags around it, then the next four above.
// Throws previz::Error if the ids are no multiple of four.
Drawing draw_stick(const TagSheet& sheet);

// Returns the side of the cube or the stick, mm: the tag with its white margin.
double face_mm(const TagSheet& sheet);

}  // namespace previz::print
