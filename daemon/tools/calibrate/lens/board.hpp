// Describes the printed board that a calibration looks at, whose points are known.
#pragma once

#include <glm/vec3.hpp>
#include <string>
#include <vector>

namespace previz::calibrate {

struct Board {
  enum class Kind { chessboard, charuco, aprilgrid } kind = Kind::chessboard;
  int columns = 0, rows = 0;  // inner corners (chessboard), squares (charuco), tags (aprilgrid)
  double square_m = 0;        // side of a square; aprilgrid: outer edge of a tag's black border
  double marker_m = 0;        // charuco: side of a marker; aprilgrid: gap between two tags
  std::string dictionary;     // charuco: "5x5_1000"; aprilgrid: the tag family
  int first_id = 0;           // aprilgrid: id of the lower left tag; ids count along the rows
  // aprilgrid: tag36h11 as Kalibr prints it, with a black border of two cells and with black
  // squares, as wide as the gap, that touch the tags' corners.
  bool is_kalibr = false;
  // The points in the board's plane, metres, by corner id: along the rows; an aprilgrid has four
  // per tag (lower left, lower right, upper right, upper left, as the tag is read).
  std::vector<glm::dvec3> points;
};

// A board is written on a command line as follows; lengths end in mm, cm, m or in:
//   chessboard:9x6:25mm                    inner corners, side of a square
//   charuco:12x8:0.709in:0.551in:5x5_1000  squares, their side, side of a marker, dictionary
//                                          (4x4, 5x5, 6x6 or 7x7 _50, _100, _250 or _1000); one
//                                          that begins with a white square, as OpenCV before 4.6
//                                          prints an even number of rows, is found as well
//   aprilgrid:6x6:88mm:26.4mm              tags, outer edge of the black border, gap between two;
//                                          then, where they differ, :tag36h11 and :0 (first id);
//                                          :kalibr prints Kalibr's form of tag36h11, which is
//                                          found without that word as well
inline constexpr const char* board_grammar =
    "chessboard:COLUMNSxROWS:SQUARE (inner corners), "
    "charuco:COLUMNSxROWS:SQUARE:MARKER:DICTIONARY (squares; 4x4_50 ... 7x7_1000) or "
    "aprilgrid:COLUMNSxROWS:TAG:GAP[:FAMILY[:FIRST_ID]] (a tag family, or kalibr: tag36h11 as "
    "Kalibr prints it); lengths as 25mm, 2.5cm, 0.025m or 1in";

// Throws previz::Error with the part that cannot be understood, and the grammar.
Board parse_board(const std::string& text);

}  // namespace previz::calibrate
