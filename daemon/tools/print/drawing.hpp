// What is printed, as plain shapes in millimetres: x to the right, y down.
#pragma once

#include <string>
#include <vector>

namespace previz::print {

struct Rectangle {
  double x = 0, y = 0, width = 0, height = 0;
};

struct Line {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  bool fold = false;  // dashed: to be folded, not cut
};

struct Words {
  double x = 0, y = 0;  // where the text's baseline begins
  double height = 0;    // of a capital letter and a bit, as printers count points
  std::string text;
};

// One thing that is cut out of the paper.
struct Drawing {
  double width = 0, height = 0;  // with its white margin
  std::string name;              // "tag36h11 id 3, 80 mm"
  std::vector<Rectangle> black;  // do not overlap
  std::vector<Line> lines;
  std::vector<Words> words;
};

}  // namespace previz::print
