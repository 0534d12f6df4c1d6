#include "daemon/calibrate/lens/board_finder.hpp"

#include <algorithm>
#include <functional>
#include <glm/geometric.hpp>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "daemon/calibrate/lens/fisheye_tags.hpp"
#include "daemon/calibrate/lens/marker_dictionary.hpp"
#include "daemon/tracking/photometry.hpp"
#include "daemon/tracking/tag_detector.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::calibrate {
namespace {

cv::Mat1b gray(const Frame& frame, const tracking::Photometry& photometry) {
  const std::vector<std::uint8_t> samples = photometry.gray8(frame);
  return cv::Mat1b(frame.height, frame.width, const_cast<std::uint8_t*>(samples.data())).clone();
}

// Returns half the window in which a corner is refined: as much of its four squares as holds no
// other corner, at most 11 px. `ids` and `pixels` are as in BoardCorners; a row has `columns`
// corners.
int window_px(const std::vector<int>& ids, const std::vector<cv::Point2f>& pixels, int columns) {
  double shortest = HUGE_VAL;
  for (std::size_t i = 0; i < ids.size(); ++i)
    for (std::size_t j = i + 1; j < ids.size(); ++j) {
      const bool beside = ids[j] == ids[i] + 1 && ids[j] % columns != 0;
      if (beside || ids[j] == ids[i] + columns)
        shortest = std::min(shortest, cv::norm(pixels[i] - pixels[j]));
    }
  return std::clamp(int(0.4 * shortest), 2, 11);
}

BoardCorners sharpened(const cv::Mat1b& picture, std::vector<int> ids,
                       std::vector<cv::Point2f> pixels, int columns) {
  const int window = window_px(ids, pixels, columns);
  const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 1e-4);
  cv::cornerSubPix(picture, pixels, {window, window}, {-1, -1}, until);
  BoardCorners corners{std::move(ids), {}};
  for (const cv::Point2f& pixel : pixels) corners.pixels.emplace_back(pixel.x, pixel.y);
  return corners;
}

class ChessboardFinder final : public BoardFinder {
 public:
  ChessboardFinder(const Board& board, const ResponseCurve& response)
      : size_(board.columns, board.rows), photometry_(response) {}

  BoardCorners find(const Frame& frame) override {
    const cv::Mat1b picture = gray(frame, photometry_);
    std::vector<cv::Point2f> pixels;
    const bool found =
        cv::findChessboardCornersSB(picture, size_, pixels,
                                    cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_EXHAUSTIVE) ||
        cv::findChessboardCorners(
            picture, size_, pixels,
            cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK);
    if (!found) return {};
    std::vector<int> ids(pixels.size());
    for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = int(i);
    return sharpened(picture, std::move(ids), std::move(pixels), size_.width);
  }

 private:
  cv::Size size_;
  tracking::Photometry photometry_;
};

class CharucoFinder final : public BoardFinder {
 public:
  CharucoFinder(const Board& board, const ResponseCurve& response)
      : columns_(board.columns - 1), dictionary_(markers_of(board)), photometry_(response) {
    board_ = charuco_board(board.columns, board.rows, float(board.square_m), float(board.marker_m),
                           dictionary_);
  }

  BoardCorners find(const Frame& frame) override {
    const cv::Mat1b picture = gray(frame, photometry_);
    std::vector<std::vector<cv::Point2f>> markers;
    std::vector<int> marker_ids, ids;
    cv::aruco::detectMarkers(picture, dictionary_, markers, marker_ids);
    std::vector<cv::Point2f> pixels;
    if (!marker_ids.empty())
      cv::aruco::interpolateCornersCharuco(markers, marker_ids, picture, board_, pixels, ids);
    // Fewer than four points do not give a pose.
    if (ids.size() < 4) return {};
    return sharpened(picture, std::move(ids), std::move(pixels), columns_);
  }

 private:
  int columns_;
  cv::Ptr<cv::aruco::Dictionary> dictionary_;
  cv::Ptr<cv::aruco::CharucoBoard> board_;
  tracking::Photometry photometry_;
};

// Finds tags of the board's family in a picture, by id.
using TagSearch = std::function<std::vector<tracking::TagDetection>(const Frame&)>;

TagSearch tag_search(const tracking::DetectorSettings& settings, const ResponseCurve& response,
                     const KnownLens& lens) {
  if (const auto* fisheye = std::get_if<FisheyeIntrinsics>(&lens))
    return [settings, response, fisheye = *fisheye](const Frame& frame) {
      return detect_in_fisheye(frame, fisheye, response, settings);
    };
  if (const auto* pinhole = std::get_if<PinholeIntrinsics>(&lens))
    return [detector = std::make_shared<tracking::TagDetector>(settings, *pinhole, response)](
               const Frame& frame) { return detector->detect(frame, 1); };
  return [settings, response](const Frame& frame) {
    PinholeIntrinsics plain;
    plain.width = frame.width;
    plain.height = frame.height;
    plain.fx = plain.fy = std::max(frame.width, frame.height);
    plain.cx = 0.5 * (frame.width - 1);
    plain.cy = 0.5 * (frame.height - 1);
    return tracking::TagDetector(settings, plain, response).detect(frame, 1);
  };
}

// Returns the picture with its white parts grown by half a pixel to each side: black squares that
// touch the tags' corners come apart from them, which libapriltag needs to see a tag's border.
Frame with_squares_apart(const Frame& frame, const cv::Mat1b& picture) {
  Frame apart = frame;
  apart.format = PixelFormat::gray8;
  cv::Mat grown;
  cv::dilate(picture, grown, cv::getStructuringElement(cv::MORPH_RECT, {2, 2}));
  apart.bytes.assign(grown.datastart, grown.dataend);
  return apart;
}

class AprilgridFinder final : public BoardFinder {
 public:
  AprilgridFinder(const Board& board, const ResponseCurve& response, const KnownLens& lens)
      : board_(board), gap_(board.marker_m / board.square_m), photometry_(response) {
    const bool has_wide = board.dictionary == "tag36h11";
    for (const bool is_wide : {false, true}) {
      if (is_wide ? !has_wide : board.is_kalibr) continue;
      for (const bool has_squares : {true, false}) {
        const tracking::DetectorSettings settings{
            .family = board.dictionary, .wide_border = is_wide, .are_edges_fitted = !has_squares};
        // with_squares_apart() gives values by the sRGB curve.
        const ResponseCurve curve = has_squares ? ResponseCurve{} : response;
        forms_.push_back({is_wide, has_squares, tag_search(settings, curve, lens)});
      }
    }
  }

  // The form that has shown most corners is searched for first; the others, if it shows none.
  BoardCorners find(const Frame& frame) override {
    if (frame.bayer != BayerPattern::none) return find(*demosaiced(std::make_shared<Frame>(frame)));
    const cv::Mat1b picture = gray(frame, photometry_);
    const auto likely = std::ranges::max_element(forms_, {}, &Form::corners);
    if (likely->corners > 0) {
      BoardCorners corners = find(*likely, frame, picture);
      likely->corners += corners.ids.size();
      if (!corners.ids.empty()) return corners;
    }
    BoardCorners best;
    Form* form_of_best = nullptr;
    for (Form& form : forms_) {
      if (likely->corners > 0 && &form == &*likely) continue;
      BoardCorners corners = find(form, frame, picture);
      if (corners.ids.size() <= best.ids.size()) continue;
      best = std::move(corners);
      form_of_best = &form;
    }
    if (form_of_best) form_of_best->corners += best.ids.size();
    return best;
  }

  std::string form() const override {
    std::size_t all = 0;
    for (const Form& form : forms_) all += form.corners;
    if (board_.dictionary != "tag36h11" || all == 0) return "";
    const Form& form = *std::ranges::max_element(forms_, {}, &Form::corners);
    std::string line = "the tags have a black border of ";
    line += form.is_wide ? "two cells, " : "one cell, ";
    line += form.has_squares ? "squares at the corners" : "no squares at the corners";
    if (form.corners < all)
      line += "; " + std::to_string(all - form.corners) + " of " + std::to_string(all) +
              " corners were found in another form";
    return line;
  }

 private:
  struct Form {
    bool is_wide = false;      // the border has two cells
    bool has_squares = false;  // at the tags' corners
    TagSearch search;
    std::size_t corners = 0;  // found in this form so far
  };
  using Tags = std::vector<tracking::TagDetection>;

  BoardCorners find(const Form& form, const Frame& frame, const cv::Mat1b& picture) const {
    const Tags tags = form.search(form.has_squares ? with_squares_apart(frame, picture) : frame);
    if (shows_squares(picture, tags) != form.has_squares) return {};
    return form.has_squares ? saddles(frame, tags, form.is_wide) : of_board(tags);
  }

  // Returns the picture's value at a place; -1 outside the picture.
  static int value(const cv::Mat1b& picture, glm::dvec2 at) {
    const cv::Point pixel(cvRound(at.x), cvRound(at.y));
    return cv::Rect({}, picture.size()).contains(pixel) ? picture(pixel) : -1;
  }

  // Returns whether most of the tags' corners touch a black square, as wide as the gap.
  bool shows_squares(const cv::Mat1b& picture, const Tags& tags) const {
    int votes = 0;
    for (const tracking::TagDetection& tag : tags) {
      const auto& c = tag.corners;
      const glm::dvec2 centre = (c[0] + c[1] + c[2] + c[3]) / 4.0;
      for (std::size_t i = 0; i < 4; ++i) {
        const glm::dvec2 beside = (c[i] + c[(i + 1) % 4]) / 2.0 - centre;
        const int square = value(picture, c[i] + gap_ * (c[i] - centre));
        const int black = value(picture, c[i] - 0.1 * (c[i] - centre));
        const int white = value(picture, centre + (1 + gap_) * beside);
        if (square >= 0 && black >= 0 && white >= 0) votes += 2 * square < black + white ? 1 : -1;
      }
    }
    return votes > 0;
  }

  // Returns the linear luminance, white = 1.
  cv::Mat1f light(const Frame& frame) const {
    cv::Mat1f light(frame.height, frame.width);
    for (int y = 0; y < frame.height; ++y)
      for (int x = 0; x < frame.width; ++x) light(y, x) = float(photometry_.luminance(frame, x, y));
    return light;
  }

  // Refines corners that are saddle points, in windows that end before the squares' other corners
  // and the tags' codes, and in linear light, where a blur leaves an edge in its place. A tag is
  // dropped if one of its corners leaves its window: cv::cornerSubPix returns that as it was given.
  BoardCorners saddles(const Frame& frame, Tags tags, bool is_wide) const {
    const cv::Mat1f picture = light(frame);
    // Over the side of a tag of tag36h11; other families have wider cells.
    const double border = is_wide ? 2 / 10.0 : 1 / 8.0;
    const cv::TermCriteria until(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 1e-4);
    for (tracking::TagDetection& tag : tags) {
      std::vector<cv::Point2f> pixels;
      double side = HUGE_VAL;
      for (std::size_t i = 0; i < 4; ++i) {
        pixels.emplace_back(float(tag.corners[i].x), float(tag.corners[i].y));
        side = std::min(side, glm::distance(tag.corners[i], tag.corners[(i + 1) % 4]));
      }
      const int window = std::clamp(int(side * std::min(gap_, border)) - 1, 2, 11);
      const cv::Rect inside(window + 1, window + 1, picture.cols - 2 * window - 2,
                            picture.rows - 2 * window - 2);
      tag.refined = std::ranges::all_of(
          pixels, [&](const cv::Point2f& p) { return inside.contains(cv::Point(p)); });
      tag.trouble.clear();
      if (!tag.refined) continue;
      const std::vector<cv::Point2f> seen = pixels;
      cv::cornerSubPix(picture, pixels, {window, window}, {-1, -1}, until);
      for (std::size_t i = 0; i < 4; ++i) {
        tag.corners[i] = {pixels[i].x, pixels[i].y};
        tag.refined = tag.refined && pixels[i] != seen[i];
      }
    }
    return of_board(tags);
  }

  BoardCorners of_board(const Tags& tags) const {
    BoardCorners corners;
    int last = -1;
    for (const tracking::TagDetection& tag : tags) {
      const int index = tag.id - board_.first_id;
      const bool is_on_board = index >= 0 && index < board_.columns * board_.rows;
      // An id that is seen twice cannot be trusted: both tags are dropped.
      if (index == last) remove(index, corners);
      if (!is_on_board || index == last || !tag.trouble.empty() || !tag.refined) continue;
      last = index;
      for (int i = 0; i < 4; ++i) {
        corners.ids.push_back(4 * index + i);
        corners.pixels.push_back(tag.corners[std::size_t(i)]);
      }
    }
    return corners;
  }

  static void remove(int index, BoardCorners& corners) {
    while (!corners.ids.empty() && corners.ids.back() / 4 == index) {
      corners.ids.pop_back();
      corners.pixels.pop_back();
    }
  }

  Board board_;
  double gap_;  // over the side of a tag
  tracking::Photometry photometry_;
  std::vector<Form> forms_;
};

}  // namespace

std::unique_ptr<BoardFinder> make_board_finder(const Board& board, const ResponseCurve& response,
                                               const KnownLens& lens) {
  switch (board.kind) {
    case Board::Kind::chessboard:
      return std::make_unique<ChessboardFinder>(board, response);
    case Board::Kind::charuco:
      return std::make_unique<CharucoFinder>(board, response);
    case Board::Kind::aprilgrid:
      break;
  }
  return std::make_unique<AprilgridFinder>(board, response, lens);
}

}  // namespace previz::calibrate
