#include "daemon/tools/calibrate/lens/marker_dictionary.hpp"

#include "drivers/error.hpp"

namespace previz::calibrate {
namespace {

cv::Ptr<cv::aruco::Dictionary> predefined(int id) {
#if CV_VERSION_MINOR >= 7
  return cv::makePtr<cv::aruco::Dictionary>(cv::aruco::getPredefinedDictionary(id));
#else
  return cv::aruco::getPredefinedDictionary(id);
#endif
}

cv::Ptr<cv::aruco::Dictionary> dictionary_by_name(const std::string& name) {
  constexpr struct {
    const char* name;
    int id;
  } known[] = {
      {"4x4_50", cv::aruco::DICT_4X4_50},   {"4x4_100", cv::aruco::DICT_4X4_100},
      {"4x4_250", cv::aruco::DICT_4X4_250}, {"4x4_1000", cv::aruco::DICT_4X4_1000},
      {"5x5_50", cv::aruco::DICT_5X5_50},   {"5x5_100", cv::aruco::DICT_5X5_100},
      {"5x5_250", cv::aruco::DICT_5X5_250}, {"5x5_1000", cv::aruco::DICT_5X5_1000},
      {"6x6_50", cv::aruco::DICT_6X6_50},   {"6x6_100", cv::aruco::DICT_6X6_100},
      {"6x6_250", cv::aruco::DICT_6X6_250}, {"6x6_1000", cv::aruco::DICT_6X6_1000},
      {"7x7_50", cv::aruco::DICT_7X7_50},   {"7x7_100", cv::aruco::DICT_7X7_100},
      {"7x7_250", cv::aruco::DICT_7X7_250}, {"7x7_1000", cv::aruco::DICT_7X7_1000},
  };
  std::string names;
  for (const auto& entry : known) {
    if (name == entry.name) return predefined(entry.id);
    add_to_list(names, entry.name);
  }
  throw Error("board: \"" + name + "\" is not a marker dictionary; known: " + names);
}

#if CV_VERSION_MINOR < 7
// Moves the markers of a board with an even number of rows, on which as many squares are white with
// either colour first. A corner's nearest markers are in the two white squares that it touches.
void put_white_first(int columns, int rows, float square, cv::aruco::CharucoBoard& board) {
  std::vector<cv::Point3f> first = board.objPoints[0];  // in the second square
  for (cv::Point3f& corner : first) corner.x -= square;
  for (auto* nearest : {&board.nearestMarkerIdx, &board.nearestMarkerCorners})
    for (std::vector<int>& of_corner : *nearest) of_corner.clear();
  int id = 0;
  for (int y = 0; y < rows; ++y)
    for (int x = y % 2; x < columns; x += 2, ++id)
      for (int i = 0; i < 4; ++i) {  // upper left, upper right, lower right, lower left
        const int left = i == 0 || i == 3 ? 1 : 0, above = i < 2 ? 1 : 0;
        const auto at = static_cast<std::size_t>(i);
        board.objPoints[std::size_t(id)][at] =
            first[at] + cv::Point3f(float(x) * square, float(y) * square, 0);
        const int column = x - left, row = y - above;  // of the board's corner there
        if (column < 0 || row < 0 || column >= columns - 1 || row >= rows - 1) continue;
        const auto corner = std::size_t(row * (columns - 1) + column);
        board.nearestMarkerIdx[corner].push_back(id);
        board.nearestMarkerCorners[corner].push_back(i);
      }
}
#endif

}  // namespace

cv::Ptr<cv::aruco::Dictionary> markers_of(const Board& board) {
  const auto dictionary = dictionary_by_name(board.dictionary);
  const int markers = board.columns * board.rows / 2;
  if (markers > dictionary->bytesList.rows)
    throw Error("board: " + std::to_string(markers) + " markers are more than dictionary " +
                board.dictionary + " has");
  return dictionary;
}

cv::Mat1b marker_picture(const cv::aruco::Dictionary& dictionary, int id, int cells) {
  cv::Mat1b picture;
#if CV_VERSION_MINOR >= 7
  dictionary.generateImageMarker(id, cells, picture);
#else
  dictionary.drawMarker(id, cells, picture);
#endif
  return picture;
}

cv::Ptr<cv::aruco::CharucoBoard> charuco_board(int columns, int rows, float square, float marker,
                                               const cv::Ptr<cv::aruco::Dictionary>& dictionary,
                                               bool is_white_first) {
#if CV_VERSION_MINOR >= 7
  auto board =
      cv::makePtr<cv::aruco::CharucoBoard>(cv::Size(columns, rows), square, marker, *dictionary);
  board->setLegacyPattern(is_white_first);
#else
  auto board = cv::aruco::CharucoBoard::create(columns, rows, square, marker, dictionary);
  if (is_white_first) put_white_first(columns, rows, square, *board);
#endif
  return board;
}

const std::vector<std::vector<cv::Point3f>>& points_of(const cv::aruco::CharucoBoard& board) {
#if CV_VERSION_MINOR >= 7
  return board.getObjPoints();
#else
  return board.objPoints;
#endif
}

}  // namespace previz::calibrate
