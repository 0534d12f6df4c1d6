#include "daemon/tools/calibrate/lens/board_finder.hpp"

#include <algorithm>
#include <functional>
#include <glm/geometric.hpp>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "daemon/core/tracking/photometry.hpp"
#include "daemon/core/tracking/tag_detector.hpp"
#include "daemon/tools/calibrate/lens/fisheye_tags.hpp"
#include "daemon/tools/calibrate/lens/marker_dictionary.hpp"
#include "drivers/error.hpp"
#include "drivers/plate.hpp"

namespace previz::calibrate {
namespace {

cv::Mat1b gray(const Frame& frame, const tracking::Photometry& photometry) {
  const std::vector<std::uint8_t> samples = photometry.gray8(frame);
  return cv::Mat1b(frame.height, frame.width, const_cast<std::uint8_t*>(samples.data())).clone();
}

// Returns half the window in which a corner is refined: as much of its four squares as holds no
// other corner, `part` of a square, at most 11 px. `ids` and `pixels` are as in BoardCorners; a row
// has `columns` corners.
int window_px(const std::vector<int>& ids, const std::vector<cv::Point2f>& pixels, int columns,
              double part) {
  double shortest = HUGE_VAL;
  for (std::size_t i = 0; i < ids.size(); ++i)
    for (std::size_t j = i + 1; j < ids.size(); ++j) {
      const bool beside = ids[j] == ids[i] + 1 && ids[j] % columns != 0;
      if (beside || ids[j] == ids[i] + columns)
        shortest = std::min(shortest, cv::norm(pixels[i] - pixels[j]));
    }
  return std::clamp(int(part * shortest), 2, 11);
}

BoardCorners sharpened(const cv::Mat1b& picture, std::vector<int> ids,
                       std::vector<cv::Point2f> pixels, int columns, double part = 0.4) {
  const int window = window_px(ids, pixels, columns, part);
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
      : columns_(board.columns - 1),
        gap_(std::min(0.4, (board.square_m - board.marker_m) / (2 * board.square_m))),
        dictionary_(markers_of(board)),
        photometry_(response) {
    for (const bool is_white_first : {false, true})
      if (!is_white_first || board.rows % 2 == 0)
        forms_.push_back({charuco_board(board.columns, board.rows, float(board.square_m),
                                        float(board.marker_m), dictionary_, is_white_first),
                          0});
  }

  BoardCorners find(const Frame& frame) override {
    const cv::Mat1b picture = gray(frame, photometry_);
    Corners markers;
    std::vector<int> marker_ids, ids;
    cv::aruco::detectMarkers(picture, dictionary_, markers, marker_ids);
    std::vector<cv::Point2f> pixels;
    Form& form = form_of(markers, marker_ids);
    if (!marker_ids.empty())
      cv::aruco::interpolateCornersCharuco(markers, marker_ids, picture, form.board, pixels, ids);
    // Fewer than four points do not give a pose.
    if (ids.size() < 4) return {};
    form.corners += ids.size();
    return sharpened(picture, std::move(ids), std::move(pixels), columns_, gap_);
  }

  std::string form() const override {
    if (forms_.size() < 2 || forms_[1].corners == 0) return "";
    const std::size_t all = forms_[0].corners + forms_[1].corners;
    std::string line =
        "the board begins with a white square, as OpenCV before 4.6 prints an even number of rows";
    if (forms_[1].corners < all)
      line += "; " + std::to_string(forms_[0].corners) + " of " + std::to_string(all) +
              " corners were found on one that begins with a black square";
    return line;
  }

 private:
  struct Form {
    cv::Ptr<cv::aruco::CharucoBoard> board;
    std::size_t corners = 0;  // found in this form so far
  };
  using Corners = std::vector<std::vector<cv::Point2f>>;

  // Returns the form that has the markers beside each other as they are; the one that has shown
  // most corners, where they do not tell: those of one row are the same in both.
  Form& form_of(const Corners& markers, const std::vector<int>& ids) {
    Form& likely = *std::ranges::max_element(forms_, {}, &Form::corners);
    Form* best = &likely;
    double least = HUGE_VAL, most = 0;
    for (Form& form : forms_) {
      const double off = distance_of(*form.board, markers, ids);
      if (off < least) best = &form;
      least = std::min(least, off);
      most = std::max(most, off);
    }
    return least < 0.5 && most > 0.5 ? *best : likely;
  }

  // Returns by how much markers whose squares touch at a corner in this form are elsewhere, as the
  // mean in squares: near 0 through any lens, and about 2 in the wrong form. None: 0.
  static double distance_of(const cv::aruco::CharucoBoard& board, const Corners& markers,
                            const std::vector<int>& ids) {
    const auto& known = points_of(board);
    double sum = 0;
    int pairs = 0;
    for (std::size_t i = 0; i < ids.size(); ++i)
      for (std::size_t j = 0; j < ids.size(); ++j) {
        if (std::max(ids[i], ids[j]) >= int(known.size())) continue;
        const cv::Point3f step = known[std::size_t(ids[j])][0] - known[std::size_t(ids[i])][0];
        const float right = step.x / board.getSquareLength(),
                    down = step.y / board.getSquareLength();
        if (std::lround(std::abs(right)) != 1 || std::lround(std::abs(down)) != 1) continue;
        const auto& from = markers[i];
        const auto& to = markers[j];
        const float marker = 4 * board.getMarkerLength() / board.getSquareLength();
        // One square to the right and down, between the two.
        const cv::Point2f x =
            (from[1] - from[0] + from[2] - from[3] + to[1] - to[0] + to[2] - to[3]) / marker;
        const cv::Point2f y =
            (from[3] - from[0] + from[2] - from[1] + to[3] - to[0] + to[2] - to[1]) / marker;
        sum += cv::norm(to[0] - from[0] - right * x - down * y) / std::max(cv::norm(x), 1e-6);
        ++pairs;
      }
    return pairs ? sum / pairs : 0;
  }

  int columns_;
  double gap_;  // between a corner and the markers beside it, in squares, at most 0.4
  cv::Ptr<cv::aruco::Dictionary> dictionary_;
  std::vector<Form> forms_;
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
