#include "daemon/tools/calibrate/lens/board_guess.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <set>

#include "daemon/core/set/tag_families.hpp"
#include "daemon/core/tracking/photometry.hpp"
#include "daemon/core/tracking/tag_detector.hpp"
#include "daemon/tools/calibrate/lens/marker_dictionary.hpp"

namespace previz::calibrate {
namespace {

using Pictures = std::vector<std::shared_ptr<const Frame>>;

// The least different ids that count as a board: fewer may be patterns of the room.
constexpr std::size_t least_markers = 3;

cv::Mat1b gray(const Frame& frame, const ResponseCurve& response) {
  const std::vector<std::uint8_t> samples = tracking::Photometry(response).gray8(frame);
  return cv::Mat1b(frame.height, frame.width, const_cast<std::uint8_t*>(samples.data())).clone();
}

// Returns the board as it is written with another number of columns and rows.
std::string chessboard_words(cv::Size corners, double square_m) {
  return fmt::format("chessboard:{}x{}:{:g}mm", corners.width, corners.height, 1000 * square_m);
}

// Returns the inner corners of the largest chessboard in the picture; none: 0x0. With
// CALIB_CB_NORMALIZE_IMAGE OpenCV loses soft boards with squares of 12 to 18 px, or finds a part of
// them, and without it those that are lit unevenly.
cv::Size largest_chessboard(const cv::Mat1b& picture) {
  cv::Size largest;
  for (const int flag : {int(cv::CALIB_CB_NORMALIZE_IMAGE), 0}) {
    cv::Mat corners, meta;
    if (cv::findChessboardCornersSB(picture, {3, 3}, corners, flag | cv::CALIB_CB_LARGER, meta) &&
        meta.cols * meta.rows > largest.area())
      largest = {meta.cols, meta.rows};
  }
  return largest;
}

std::string other_chessboard(const Pictures& pictures, const Board& board,
                             const ResponseCurve& response) {
  cv::Size largest;
  for (const auto& picture : pictures) {
    const cv::Size size = largest_chessboard(gray(*picture, response));
    if (size.area() > largest.area()) largest = size;
  }
  const cv::Size named(board.columns, board.rows), turned(board.rows, board.columns);
  if (largest.area() == 0 || largest == named || largest == turned) return "";
  // As people hold it: the longer side first, as it was named.
  if ((largest.width < largest.height) != (named.width < named.height))
    std::swap(largest.width, largest.height);
  return fmt::format(
      "the pictures hold a chessboard of {}x{} inner corners ({}x{} squares): --board {}",
      largest.width, largest.height, largest.width + 1, largest.height + 1,
      chessboard_words(largest, board.square_m));
}

// The markers or tags of one dictionary or family that pictures show.
struct Seen {
  std::string name;
  std::size_t count = 0;  // over all pictures
  std::set<int> ids;
};

// The ids of a board follow one another; those that a dictionary of a thousand sees in the patterns
// of a room, or in tags of another kind, do not.
bool is_of_a_board(const Seen& seen) {
  if (seen.ids.size() < least_markers) return false;
  return 2 * seen.ids.size() > std::size_t(*seen.ids.rbegin() - *seen.ids.begin());
}

std::string ids_words(const Seen& seen) {
  return seen.ids.size() == 1 ? fmt::format("id {}", *seen.ids.begin())
                              : fmt::format("ids {} to {}", *seen.ids.begin(), *seen.ids.rbegin());
}

// Returns the smallest dictionary of these markers that has the id.
std::string dictionary_with(const std::string& cells, int id) {
  for (const int size : {50, 100, 250})
    if (id < size) return fmt::format("{}_{}", cells, size);
  return cells + "_1000";
}

std::string other_charuco(const Pictures& pictures, const Board& board,
                          const ResponseCurve& response) {
  Seen most;
  for (const char* cells : {"4x4", "5x5", "6x6", "7x7"}) {
    // A dictionary begins with those of the smaller ones of its cells.
    Seen seen{cells, 0, {}};
    Board largest = board;
    largest.dictionary = std::string(cells) + "_1000";
    const cv::Ptr<cv::aruco::Dictionary> dictionary = markers_of(largest);
    for (const auto& picture : pictures) {
      std::vector<std::vector<cv::Point2f>> corners;
      std::vector<int> ids;
      cv::aruco::detectMarkers(gray(*picture, response), dictionary, corners, ids);
      seen.count += ids.size();
      seen.ids.insert(ids.begin(), ids.end());
    }
    if (seen.count > most.count && is_of_a_board(seen)) most = seen;
  }
  if (most.count == 0) return "";
  const std::string dictionary = dictionary_with(most.name, *most.ids.rbegin());
  const bool is_named = board.dictionary.starts_with(most.name);
  if (is_named && *most.ids.rbegin() < board.columns * board.rows / 2)
    return fmt::format(
        "the pictures hold markers of {}, {}, but not in the places that a board of {}x{} squares "
        "has them: count its squares, columns first",
        board.dictionary, ids_words(most), board.columns, board.rows);
  return fmt::format(
      "the pictures hold markers of {} ({}): end --board with that dictionary; such a board has {} "
      "squares at least",
      dictionary, ids_words(most), 2 * (*most.ids.rbegin() + 1) - 1);
}

Seen seen_tags(const Pictures& pictures, const std::string& family, bool wide_border,
               const ResponseCurve& response) {
  Seen seen{family, 0, {}};
  for (const auto& picture : pictures) {
    PinholeIntrinsics plain;
    plain.width = picture->width;
    plain.height = picture->height;
    plain.fx = plain.fy = std::max(picture->width, picture->height);
    plain.cx = 0.5 * (picture->width - 1);
    plain.cy = 0.5 * (picture->height - 1);
    const tracking::DetectorSettings settings{
        .family = family, .wide_border = wide_border, .are_edges_fitted = false};
    for (const auto& tag : tracking::TagDetector(settings, plain, response).detect(*picture, 1)) {
      ++seen.count;
      seen.ids.insert(tag.id);
    }
  }
  return seen;
}

std::string other_aprilgrid(const Pictures& pictures, const Board& board,
                            const ResponseCurve& response) {
  Seen most = seen_tags(pictures, "tag36h11", true, response);
  bool is_wide = most.count > 0;
  for (const char* family : set::tag_families) {
    const Seen seen = seen_tags(pictures, family, false, response);
    if (seen.count <= most.count) continue;
    most = seen;
    is_wide = false;
  }
  if (most.ids.size() < least_markers) return "";
  const std::string words =
      fmt::format("the pictures hold tags of {}{}, {}", most.name,
                  is_wide ? " with a border of two cells" : "", ids_words(most));
  if (most.name != board.dictionary)
    return words +
           ": name that family after the gap, --board aprilgrid:COLUMNSxROWS:TAG:GAP:" + most.name;
  if (board.is_kalibr && !is_wide)
    return words + " with a border of one cell: remove the word kalibr";
  const int last = board.first_id + board.columns * board.rows - 1;
  if (*most.ids.begin() >= board.first_id && *most.ids.rbegin() <= last) return "";
  return words + fmt::format(
                     ", and --board names ids {} to {}: count its tags, and name the id of the one "
                     "at the lower left last, --board aprilgrid:COLUMNSxROWS:TAG:GAP:{}:{}",
                     board.first_id, last, most.name, *most.ids.begin());
}

}  // namespace

std::string other_board(const Pictures& pictures, const Board& board,
                        const ResponseCurve& response) {
  switch (board.kind) {
    case Board::Kind::chessboard:
      return other_chessboard(pictures, board, response);
    case Board::Kind::charuco:
      return other_charuco(pictures, board, response);
    case Board::Kind::aprilgrid:
      break;
  }
  return other_aprilgrid(pictures, board, response);
}

}  // namespace previz::calibrate
