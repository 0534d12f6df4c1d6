#include "daemon/tools/calibrate/lens/board.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <sstream>

#include "daemon/core/set/tag_families.hpp"
#include "daemon/tools/calibrate/lens/length.hpp"
#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

class BoardText {
 public:
  explicit BoardText(const std::string& text) : text_(text) {
    std::istringstream stream(text);
    for (std::string part; std::getline(stream, part, ':');) parts_.push_back(part);
  }

  bool has(std::size_t i) const { return i < parts_.size(); }
  const std::string& part(std::size_t i, const std::string& what) const {
    if (!has(i)) fail("has no " + what);
    return parts_[i];
  }
  void ends_after(std::size_t count) const {
    if (parts_.size() > count) fail("has an extra field \"" + parts_[count] + "\"");
  }
  [[noreturn]] void fail(const std::string& what) const {
    throw Error("board \"" + text_ + "\" " + what + "; allowed: " + board_grammar);
  }

  int whole(std::size_t i, const std::string& what) const {
    return whole_number(part(i, what), what, 0);
  }
  void size(std::size_t i, int least, Board& board) const {
    const std::string& size = part(i, "size");
    const std::size_t cross = size.find('x');
    if (cross == std::string::npos) fail("has an invalid size \"" + size + "\"");
    board.columns = whole_number(size.substr(0, cross), "number of columns", least);
    board.rows = whole_number(size.substr(cross + 1), "number of rows", least);
  }
  double length_m(std::size_t i, const std::string& what) const {
    const std::string& length = part(i, what);
    if (const auto metres = parse_length(length)) return *metres;
    fail("has " + what + " \"" + length + "\"");
  }

 private:
  int whole_number(const std::string& text, const std::string& what, int least) const {
    constexpr int most = 1000;
    int number = 0;
    const auto read = std::from_chars(text.data(), text.data() + text.size(), number);
    if (read.ec != std::errc{} || read.ptr != text.data() + text.size() || number < least ||
        number > most)
      fail("has " + what + " \"" + text + "\" (" + std::to_string(least) + " to " +
           std::to_string(most) + " are allowed)");
    return number;
  }

  std::string text_;
  std::vector<std::string> parts_;
};

void add_lattice(int columns, int rows, double pitch_m, Board& board) {
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column)
      board.points.emplace_back(column * pitch_m, row * pitch_m, 0);
}

void add_tags(Board& board) {
  const double pitch = board.square_m + board.marker_m, s = board.square_m;
  for (int row = 0; row < board.rows; ++row)
    for (int column = 0; column < board.columns; ++column) {
      const glm::dvec3 corner(column * pitch, row * pitch, 0);
      for (const glm::dvec3& offset :
           {glm::dvec3(0, 0, 0), glm::dvec3(s, 0, 0), glm::dvec3(s, s, 0), glm::dvec3(0, s, 0)})
        board.points.push_back(corner + offset);
    }
}

}  // namespace

Board parse_board(const std::string& text) {
  const BoardText parts(text);
  Board board;
  const std::string& kind = parts.part(0, "kind");
  if (kind == "chessboard") {
    parts.size(1, 3, board);  // cv::findChessboardCorners needs at least 3 corners a side
    board.square_m = parts.length_m(2, "square");
    parts.ends_after(3);
    add_lattice(board.columns, board.rows, board.square_m, board);
  } else if (kind == "charuco") {
    board.kind = Board::Kind::charuco;
    parts.size(1, 3, board);
    board.square_m = parts.length_m(2, "square");
    board.marker_m = parts.length_m(3, "marker");
    board.dictionary = parts.part(4, "dictionary");
    parts.ends_after(5);
    if (board.marker_m >= board.square_m) parts.fail("needs markers smaller than its squares");
    add_lattice(board.columns - 1, board.rows - 1, board.square_m, board);
  } else if (kind == "aprilgrid") {
    board.kind = Board::Kind::aprilgrid;
    parts.size(1, 1, board);
    board.square_m = parts.length_m(2, "tag");
    board.marker_m = parts.length_m(3, "gap");
    const std::string family = parts.has(4) ? parts.part(4, "family") : "tag36h11";
    board.is_kalibr = family == "kalibr";
    board.dictionary = board.is_kalibr ? "tag36h11" : family;
    if (std::ranges::count(set::tag_families, board.dictionary) == 0)
      parts.fail(fmt::format("has tags of the family \"{}\", which is unknown (known: {})", family,
                             fmt::join(set::tag_families, ", ")));
    board.first_id = parts.has(5) ? parts.whole(5, "first id") : 0;
    parts.ends_after(6);
    add_tags(board);
  } else {
    parts.fail("is of unknown kind \"" + kind + "\"");
  }
  return board;
}

}  // namespace previz::calibrate
