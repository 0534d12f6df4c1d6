// Lays drawings out on sheets of paper: several a sheet, or one over several sheets.
#pragma once

#include <string>
#include <vector>

#include "daemon/tools/print/drawing.hpp"

namespace previz::print {

struct Paper {
  std::string name;
  double width = 0, height = 0;  // mm, upright
};

// A4, A3 or Letter; throws previz::Error naming them.
Paper paper_by_name(const std::string& name);

// A drawing on a sheet, or the part of one that the window shows.
struct Placed {
  std::size_t drawing = 0;
  double x = 0, y = 0;  // where the drawing's upper left corner is on the sheet
  Rectangle window;     // on the sheet; nothing is printed outside
};

struct Sheet {
  double width = 0, height = 0;
  std::vector<Placed> placed;
  std::string title;  // what it is and, of several, which
};

// The margins, which printers leave white and crop marks reach into, and the strip below with the
// ruler and the title. A chessboard of 10x7 squares of 25 mm goes on A4.
inline constexpr double sheet_margin_mm = 7, sheet_footer_mm = 12;
// Between drawings, for their crop marks.
inline constexpr double gutter_mm = 8;
inline constexpr int most_sheets_of_a_drawing = 64;

// All drawings must be of one size; `title` is what they are together. The paper is turned if that
// takes fewer sheets. A drawing that is larger than the paper is cut into tiles whose edges meet.
// Throws previz::Error if that would take more than 64 sheets.
std::vector<Sheet> lay_out(const std::vector<Drawing>& drawings, const Paper& paper,
                           const std::string& title);

}  // namespace previz::print
