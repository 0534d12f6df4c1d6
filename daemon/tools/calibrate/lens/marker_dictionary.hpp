// Knows the markers of ChArUco boards by name; and OpenCV's two ways to hold them, by pointers
// (4.6, Debian 12) and by value (4.10, Debian 13).
#pragma once

#include <opencv2/aruco/charuco.hpp>

#include "daemon/tools/calibrate/lens/board.hpp"

namespace previz::calibrate {

// Returns the markers of a ChArUco board; throws previz::Error if its dictionary is not known, or
// has too few.
cv::Ptr<cv::aruco::Dictionary> markers_of(const Board& board);

// Returns a marker's picture, black on white, of `cells` x `cells` pixels, its border among them.
cv::Mat1b marker_picture(const cv::aruco::Dictionary& dictionary, int id, int cells);

// Returns a board of squares of `square`, and of markers of `marker`, in any unit. Its first square
// is black, as OpenCV prints it since version 4.6, or white (`is_white_first`), as versions before
// print an even number of rows (opencv_contrib #3291, opencv #23152); the ids of the markers count
// along the rows, from the upper left, in both.
cv::Ptr<cv::aruco::CharucoBoard> charuco_board(int columns, int rows, float square, float marker,
                                               const cv::Ptr<cv::aruco::Dictionary>& dictionary,
                                               bool is_white_first = false);

// Returns the corners of a board's markers, by id: upper left, upper right, lower right, lower
// left.
const std::vector<std::vector<cv::Point3f>>& points_of(const cv::aruco::CharucoBoard& board);

}  // namespace previz::calibrate
