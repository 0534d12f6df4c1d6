// Finds the board's points in one picture.
#pragma once

#include <glm/vec2.hpp>
#include <memory>
#include <string>
#include <variant>
#include <vector>

#include "daemon/tools/calibrate/lens/board.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::calibrate {

struct BoardCorners {
  std::vector<int> ids;            // indices into Board::points, rising
  std::vector<glm::dvec2> pixels;  // (0,0) is the centre of the top-left pixel
};

class BoardFinder {
 public:
  virtual ~BoardFinder() = default;
  // Returns nothing if the board is not seen. A chessboard is seen whole or not at all.
  virtual BoardCorners find(const Frame& frame) = 0;
  // Returns a line on the form of the board in the pictures; empty if a board has only one form.
  virtual std::string form() const { return {}; }
};

// `response` is the camera's. Chessboards are found by cv::findChessboardCornersSB (Duda and Frese
// 2018, "Accurate Detection and Localization of Checkerboard Corners for Calibration") and, if that
// finds none, by cv::findChessboardCorners; charuco boards by cv::aruco, of an even number of rows
// those that begin with a black square and with a white one; both are refined by cv::cornerSubPix.
// An aprilgrid is found by this project's own tag corners, whose edges are straight only through
// `lens`; if none is known yet, a lens without distortion is assumed. Of tag36h11 the borders of
// one cell and of two (Kalibr's) are tried. Black squares in the gaps' crossings (Kalibr's too)
// make a tag's corner a saddle point, which cv::cornerSubPix refines. A finder tries the form that
// it has found first in the pictures that follow. Edges need the right `response`: linear values
// that are read as sRGB move each by about half a pixel outwards.
using KnownLens = std::variant<std::monostate, PinholeIntrinsics, FisheyeIntrinsics>;
std::unique_ptr<BoardFinder> make_board_finder(const Board& board, const ResponseCurve& response,
                                               const KnownLens& lens = {});

// Returns whether a second pass with the lens found in the first one is worth while.
inline bool needs_lens(const Board& board) {
  return board.kind == Board::Kind::aprilgrid;
}

}  // namespace previz::calibrate
