// Knows the markers of ChArUco boards by name.
#pragma once

#include <opencv2/aruco/dictionary.hpp>

#include "daemon/calibrate/lens/board.hpp"

namespace previz::calibrate {

// Returns the markers of a ChArUco board; throws previz::Error if its dictionary is not known, or
// has too few.
cv::Ptr<cv::aruco::Dictionary> markers_of(const Board& board);

}  // namespace previz::calibrate
