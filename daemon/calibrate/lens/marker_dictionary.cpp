#include "daemon/calibrate/lens/marker_dictionary.hpp"

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
                                               const cv::Ptr<cv::aruco::Dictionary>& dictionary) {
#if CV_VERSION_MINOR >= 7
  return cv::makePtr<cv::aruco::CharucoBoard>(cv::Size(columns, rows), square, marker, *dictionary);
#else
  return cv::aruco::CharucoBoard::create(columns, rows, square, marker, dictionary);
#endif
}

}  // namespace previz::calibrate
