#include "daemon/tools/print/boards.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/aruco/charuco.hpp>

#include "daemon/tools/calibrate/lens/marker_dictionary.hpp"
#include "daemon/tools/print/tag_cells.hpp"
#include "drivers/error.hpp"

namespace previz::print {
namespace {

constexpr double mm_per_m = 1000, widest_margin_mm = 4;

// Makes room for `width` x `height` mm inside a white margin.
Drawing framed(double width, double height, double margin, const std::string& name) {
  Drawing drawing;
  drawing.width = width + 2 * margin;
  drawing.height = height + 2 * margin;
  drawing.name = name;
  return drawing;
}

// Adds the squares at which the sum of column and row is even, column and row from the upper left.
void add_squares(int columns, int rows, double square, double margin, Drawing& drawing) {
  for (int row = 0; row < rows; ++row)
    for (int column = row % 2; column < columns; column += 2)
      drawing.black.push_back({margin + column * square, margin + row * square, square, square});
}

Drawing chessboard(const calibrate::Board& board, const std::string& name) {
  const double square = mm_per_m * board.square_m;
  const double margin = std::min(square, widest_margin_mm);
  const int columns = board.columns + 1, rows = board.rows + 1;
  Drawing drawing = framed(columns * square, rows * square, margin, name);
  add_squares(columns, rows, square, margin, drawing);
  return drawing;
}

// Adds a marker with its upper left corner at (x, y).
void add_marker(const cv::Ptr<cv::aruco::Dictionary>& dictionary, int id, double x, double y,
                double side, Drawing& drawing) {
  const int cells = dictionary->markerSize + 2;
  const cv::Mat1b picture = calibrate::marker_picture(*dictionary, id, cells);
  const double cell = side / cells;
  for (int row = 0; row < cells; ++row)
    for (int column = 0; column < cells; ++column) {
      const auto black = [&](int at) { return picture(row, at) == 0; };
      if (!black(column)) continue;
      int end = column;
      while (end < cells && black(end)) ++end;
      drawing.black.push_back({x + column * cell, y + row * cell, (end - column) * cell, cell});
      column = end;
    }
}

Drawing charuco(const calibrate::Board& board, const std::string& name) {
  const auto dictionary = calibrate::markers_of(board);
  const double square = mm_per_m * board.square_m, marker = mm_per_m * board.marker_m;
  const double margin = std::min(square, widest_margin_mm);
  Drawing drawing = framed(board.columns * square, board.rows * square, margin, name);
  add_squares(board.columns, board.rows, square, margin, drawing);
  // As cv::aruco::CharucoBoard numbers them: along the rows, from the upper left.
  int id = 0;
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column) {
      if (row % 2 == column % 2) continue;
      const double inset = margin + (square - marker) / 2;
      add_marker(dictionary, id++, inset + column * square, inset + row * square, marker, drawing);
    }
  return drawing;
}

// Adds a ring of `width` inside the square of `side` whose upper left corner is at (x, y).
void add_ring(double x, double y, double side, double width, Drawing& drawing) {
  const double inner = side - 2 * width;
  drawing.black.push_back({x, y, side, width});
  drawing.black.push_back({x, y + side - width, side, width});
  drawing.black.push_back({x, y + width, width, inner});
  drawing.black.push_back({x + side - width, y + width, width, inner});
}

// Adds the squares in the crossings of the gaps, the outermost among them; the upper left tag is at
// (`at`, `at`).
void add_corner_squares(const calibrate::Board& board, double at, Drawing& drawing) {
  const double gap = mm_per_m * board.marker_m, pitch = mm_per_m * board.square_m + gap;
  for (int row = 0; row <= board.rows; ++row)
    for (int column = 0; column <= board.columns; ++column)
      drawing.black.push_back({at - gap + column * pitch, at - gap + row * pitch, gap, gap});
}

Drawing aprilgrid(const calibrate::Board& board, const std::string& name) {
  FamilyShape shape = family_shape(board.dictionary);
  if (board.is_kalibr) shape.total += 2, shape.border += 2;
  const double tag = mm_per_m * board.square_m, gap = mm_per_m * board.marker_m;
  const double cell = tag / shape.border, outside = (shape.total - shape.border) * cell / 2;
  if (gap < 2 * outside)
    throw Error(
        fmt::format("board \"{}\" has overlapping tags: {} of {:g} mm needs a "
                    "gap of {:g} mm or more",
                    name, board.dictionary, tag, 2 * outside));
  const double margin = board.is_kalibr ? gap + cell : std::max(gap, outside + cell);
  Drawing drawing =
      framed(board.columns * (tag + gap) - gap, board.rows * (tag + gap) - gap, margin, name);
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column) {
      const int from_top = board.rows - 1 - row;  // ids count upwards from the lower left
      const double x = margin + column * (tag + gap), y = margin + from_top * (tag + gap);
      // Of tag36h11 the white cells about the border become the border's outer cells.
      const double outer = board.is_kalibr ? 0 : outside;
      if (board.is_kalibr) add_ring(x, y, tag, cell, drawing);
      add_tag_cells(board.dictionary, board.first_id + row * board.columns + column, x - outer,
                    y - outer, cell, drawing);
    }
  if (board.is_kalibr) add_corner_squares(board, margin, drawing);
  return drawing;
}

}  // namespace

Drawing draw_board(const calibrate::Board& board, const std::string& name) {
  switch (board.kind) {
    case calibrate::Board::Kind::chessboard:
      return chessboard(board, name);
    case calibrate::Board::Kind::charuco:
      return charuco(board, name);
    case calibrate::Board::Kind::aprilgrid:
      return aprilgrid(board, name);
  }
  return {};
}

}  // namespace previz::print
