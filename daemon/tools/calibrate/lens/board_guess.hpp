// Says which board pictures hold, where it is not the one that was named.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "daemon/tools/calibrate/lens/board.hpp"
#include "drivers/calibration.hpp"
#include "drivers/frame.hpp"

namespace previz::calibrate {

// Returns what the pictures hold in place of the board, and how to name it: "the pictures hold a
// chessboard of 9x6 inner corners (10x7 squares): --board chessboard:9x6:25mm". For a chessboard
// that is the largest number of inner corners that cv::findChessboardCornersSB finds; for markers
// and tags, the dictionary or family (and border) of which most are seen, and their ids. Empty:
// they hold nothing like it, or what they hold is the board. Takes a second a picture, or two.
std::string other_board(const std::vector<std::shared_ptr<const Frame>>& pictures,
                        const Board& board, const ResponseCurve& response);

}  // namespace previz::calibrate
