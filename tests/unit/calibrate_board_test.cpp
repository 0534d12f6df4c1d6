// Boards as they are written, and found in pictures whose corners are known exactly.
#include <apriltag/apriltag.h>
#include <apriltag/tag36h11.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <glm/geometric.hpp>
#include <opencv2/aruco/charuco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "daemon/calibrate/board.hpp"
#include "daemon/calibrate/board_finder.hpp"
#include "daemon/calibrate/observer.hpp"
#include "daemon/calibrate/views.hpp"
#include "drivers/error.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::calibrate {
namespace calibrate_board_test {

std::string problem(const std::string& text) {
  try {
    parse_board(text);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Board, IsReadAsWritten) {
  const Board chess = parse_board("chessboard:9x6:25mm");
  EXPECT_EQ(chess.points.size(), 54u);
  EXPECT_EQ(chess.points[53], glm::dvec3(8 * 0.025, 5 * 0.025, 0));
  const Board charuco = parse_board("charuco:12x8:0.709in:0.551in:5x5_1000");
  EXPECT_EQ(charuco.points.size(), 77u);
  EXPECT_NEAR(charuco.square_m, 0.709 * 0.0254, 1e-15);
  const Board grid = parse_board("aprilgrid:6x5:8.8cm:0.0264m:tag25h9:4");
  EXPECT_EQ(grid.points.size(), 120u);
  EXPECT_EQ(grid.first_id, 4);
  EXPECT_EQ(grid.dictionary, "tag25h9");
  EXPECT_NEAR(glm::distance(grid.points[4], glm::dvec3(0.088 + 0.0264, 0, 0)), 0, 1e-15);
  EXPECT_EQ(parse_board("aprilgrid:6x5:88mm:26mm").dictionary, "tag36h11");
}

TEST(Board, EveryMistakeIsNamed) {
  EXPECT_NE(problem("checkers:9x6:25mm").find("kind \"checkers\""), std::string::npos);
  EXPECT_NE(problem("chessboard:9:25mm").find("size \"9\""), std::string::npos);
  EXPECT_NE(problem("chessboard:9x2:25mm").find("rows \"2\""), std::string::npos);
  EXPECT_NE(problem("chessboard:9x6").find("no square"), std::string::npos);
  EXPECT_NE(problem("chessboard:9x6:25").find("square \"25\""), std::string::npos);
  EXPECT_NE(problem("chessboard:9x6:-25mm").find("square \"-25mm\""), std::string::npos);
  EXPECT_NE(problem("chessboard:9x6:25mm:3").find("\"3\" too many"), std::string::npos);
  EXPECT_NE(problem("charuco:5x5:20mm:20mm:4x4_50").find("do not fit"), std::string::npos);
  EXPECT_NE(problem("chessboard:9x6:25mm:3").find(board_grammar), std::string::npos);
}

TEST(Board, UnknownDictionariesAndFamiliesAreNamed) {
  EXPECT_THROW(make_board_finder(parse_board("charuco:5x5:20mm:15mm:8x8_50"), {}), Error);
  EXPECT_THROW(make_board_finder(parse_board("charuco:20x20:20mm:15mm:4x4_50"), {}), Error);
}

constexpr int width = 640, height = 480;

// A board seen tilted by a pinhole camera; exact places of its corners.
glm::dvec2 seen(const glm::dvec3& point) {
  const double c = std::cos(0.5), s = std::sin(0.5);
  const glm::dvec3 x = point - glm::dvec3(0.1, 0.06, 0);
  const glm::dvec3 y(c * x.x, x.y, 0.42 + s * x.x);
  return {600 * y.x / y.z + 322.3, 600 * y.y / y.z + 238.6};
}

// Squares with exact, box-filtered edges, slightly out of focus as a lens has them.
Frame chessboard(int columns, int rows, double square_m) {
  test::LinearPicture picture{width, height, std::vector<double>(width * height, 0.7)};
  for (int row = -1; row < rows; ++row)
    for (int column = -1; column < columns; ++column) {
      if ((row + column) % 2 == 0) continue;
      const auto corner = [&](int i, int j) {
        return seen({(column + i) * square_m, (row + j) * square_m, 0});
      };
      test::add_polygon(picture, {corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)}, -0.65);
    }
  cv::Mat1d pixels(height, width, picture.value.data());
  cv::GaussianBlur(pixels, pixels, {}, 0.7);
  std::mt19937 random(1);
  return test::expose(picture, {.full_well_e = 20000, .response = {}}, random);
}

// OpenCV's corners carry no half pixel: (0,0) is a pixel's centre.
//
// Noise: white is 14000 electrons, 0.0059 of the full well; the edge, blurred by 0.7 px and by the
// pixel (sqrt(0.7^2 + 1/12) = 0.76), has a slope of 0.65 / (sqrt(2 pi) 0.76) = 0.34 a pixel. One
// pixel on an edge thus places it to 0.0059 / 0.34 = 0.017 px, and a corner's window has at least
// five on each of its edges: 0.0078 px along an axis. Of 54 corners one is farther off than 5.1
// deviations, 0.04 px, once in 10000 pictures (54 exp(-5.1^2 / 2) = 1e-4). The finder's own bias
// from squares that are tilted is stated to be below 0.05 px.
//
// The mean may have a bias only (its noise is 0.001 px): a tenth of the 0.3 px that the tracker's
// corners may be off.
TEST(BoardFinder, ChessboardCornersLieWhereTheyAre) {
  const Board board = parse_board("chessboard:9x6:25mm");
  const BoardCorners found = make_board_finder(board, {})->find(chessboard(9, 6, 0.025));
  ASSERT_EQ(found.ids.size(), 54u);
  // The finder may count from the other end: the board looks the same turned by half a turn.
  const bool turned = glm::distance(found.pixels[0], seen(board.points[0])) >
                      glm::distance(found.pixels[0], seen(board.points[53]));
  glm::dvec2 mean(0);
  for (std::size_t i = 0; i < 54; ++i) {
    const glm::dvec2 error = found.pixels[i] - seen(board.points[turned ? 53 - i : i]);
    EXPECT_LT(glm::length(error), 0.04 + 0.05) << i;
    mean += error / 54.0;
  }
  EXPECT_LT(glm::length(mean), 0.03);
}

TEST(BoardFinder, SeesNoBoardInNoise) {
  Frame frame;
  frame.format = PixelFormat::gray8;
  frame.width = 160;
  frame.height = 120;
  std::mt19937 random(3);
  for (int i = 0; i < 160 * 120; ++i) frame.bytes.push_back(std::uint8_t(random()));
  for (const char* text :
       {"chessboard:9x6:25mm", "charuco:5x5:20mm:15mm:4x4_50", "aprilgrid:3x3:88mm:26mm"})
    EXPECT_TRUE(make_board_finder(parse_board(text), {})->find(frame).ids.empty()) << text;
}

// OpenCV's own drawing of the board, enlarged by whole pixels: its corner (i, j) lies between
// pixels, at (i + 1, j + 1) squares - 0.5. There is no noise; the bound is that of the bias above.
TEST(BoardFinder, CharucoCornersHaveTheirIds) {
  const Board board = parse_board("charuco:7x5:40mm:30mm:4x4_50");
  const auto drawing = cv::aruco::CharucoBoard::create(
      7, 5, 0.04f, 0.03f, cv::aruco::getPredefinedDictionary(cv::aruco::DICT_4X4_50));
  cv::Mat1b picture;
  drawing->draw({560, 400}, picture, 0, 1);
  cv::GaussianBlur(picture, picture, {}, 0.7);
  cv::copyMakeBorder(picture, picture, 40, 40, 40, 40, cv::BORDER_CONSTANT, 255);
  Frame frame;
  frame.format = PixelFormat::gray8;
  frame.width = picture.cols;
  frame.height = picture.rows;
  frame.bytes.assign(picture.datastart, picture.dataend);
  const BoardCorners found = make_board_finder(board, {})->find(frame);
  ASSERT_EQ(found.ids.size(), 24u);
  for (std::size_t i = 0; i < 24; ++i) {
    const int column = found.ids[i] % 6, row = found.ids[i] / 6;
    const glm::dvec2 truth(40 + 80 * (column + 1) - 0.5, 40 + 80 * (row + 1) - 0.5);
    EXPECT_LT(glm::distance(found.pixels[i], truth), 0.05) << found.ids[i];
  }
}

TEST(BoardFinder, AprilgridCornersHaveTheirIds) {
  const Board board = parse_board("aprilgrid:3x2:60mm:20mm:tag36h11:7");
  test::TagScene scene;
  scene.lens = test::plain_lens(width, height, 600);
  scene.world_from_camera = test::camera_looking({0.1, -0.2, 0.45}, {0.11, 0.07, 0});
  for (int i = 0; i < 6; ++i) {
    const int column = i % 3, row = i / 3;
    scene.tags.push_back(test::flat_tag(7 + i, 0.06, {0.03 + 0.08 * column, 0.03 + 0.08 * row, 0}));
  }
  std::mt19937 random(1);
  const Frame frame =
      test::expose(test::render(scene), {.full_well_e = 20000, .response = {}}, random);
  const BoardCorners found = make_board_finder(board, {})->find(frame);
  ASSERT_EQ(found.ids.size(), 24u);
  for (std::size_t i = 0; i < 24; ++i) {
    const auto tag = std::size_t(found.ids[i] / 4);
    const glm::dvec2 truth =
        test::exact_corners(scene, scene.tags[tag])[std::size_t(found.ids[i] % 4)];
    EXPECT_LT(glm::distance(found.pixels[i], truth), 0.1) << found.ids[i];
    // And the board's own points are the scene's.
    const glm::dvec3 corner = board.points[std::size_t(found.ids[i])];
    const glm::dvec3 centre = glm::dvec3(scene.tags[tag].world_from_tag[3]);
    EXPECT_NEAR(glm::distance(corner, centre), 0.03 * std::sqrt(2.0), 1e-12);
  }
}

// Kalibr's 6x6 board (88 mm tags, gaps of 0.3 of that), 10 px
// per cell of a two-cell border; the lower left tag's lower left corner is at `kalibr_origin`.
constexpr int kalibr_tag_px = 100, kalibr_gap_px = 30, kalibr_margin_px = 60;
constexpr double kalibr_px_m = 0.088 / kalibr_tag_px;

cv::Mat1b kalibr_board(bool has_squares) {
  apriltag_family_t* family = tag36h11_create();
  const int pitch = kalibr_tag_px + kalibr_gap_px, side = 6 * pitch + kalibr_gap_px;
  cv::Mat1b board(side, side, std::uint8_t(255));
  for (int id = 0; id < 36; ++id) {
    const cv::Point at(kalibr_gap_px + id % 6 * pitch, kalibr_gap_px + (5 - id / 6) * pitch);
    board(cv::Rect(at.x, at.y, kalibr_tag_px, kalibr_tag_px)) = 0;
    image_u8_t* tag = apriltag_to_image(family, std::uint32_t(id));
    for (int y = 0; y < 6; ++y)
      for (int x = 0; x < 6; ++x)
        if (tag->buf[(y + 2) * tag->stride + x + 2])
          board(cv::Rect(at.x + 10 * (x + 2), at.y + 10 * (y + 2), 10, 10)) = 255;
    std::free(tag->buf);
    std::free(tag);
  }
  tag36h11_destroy(family);
  for (int y = 0; has_squares && y <= 6; ++y)
    for (int x = 0; x <= 6; ++x)
      board(cv::Rect(x * pitch, y * pitch, kalibr_gap_px, kalibr_gap_px)) = 0;
  const int m = kalibr_margin_px - kalibr_gap_px;
  cv::copyMakeBorder(board, board, m, m, m, m, cv::BORDER_CONSTANT, 255);
  return board;
}

struct KalibrView {
  Frame frame;
  cv::Matx33d pixel_from_board;  // from the board's metres
};

// A view by a pinhole of 620 px, 8x8 samples per pixel, slightly blurred, noise of 1.5 of 255.
KalibrView kalibr_view(const cv::Mat1b& board, cv::RNG& random) {
  const auto any = [&](double reach) { return random.uniform(-reach, reach); };
  const cv::Vec3d turn(any(0.55), any(0.55), any(0.3)), shift(any(0.06), any(0.05), 0);
  cv::Matx33d r;
  cv::Rodrigues(turn, r);
  const double half = 0.5 * (6 * 0.088 + 5 * 0.0264);
  // The board's y points up, the picture's down.
  const cv::Matx33d centred(1, 0, -half, 0, -1, half, 0, 0, 1);
  const double away = 1.1 + 0.2 * random.uniform(0.0, 1.0);
  const cv::Matx33d pose(r(0, 0), r(0, 1), shift[0], r(1, 0), r(1, 1), shift[1], r(2, 0), r(2, 1),
                         away);
  KalibrView view;
  view.pixel_from_board = cv::Matx33d(620, 0, 319.5, 0, 620, 239.5, 0, 0, 1) * pose * centred;
  const double low = board.rows - kalibr_margin_px - 0.5, left = kalibr_margin_px - 0.5;
  const cv::Matx33d board_from_drawing(kalibr_px_m, 0, -left * kalibr_px_m, 0, -kalibr_px_m,
                                       low * kalibr_px_m, 0, 0, 1);
  const cv::Matx33d finer(8, 0, 3.5, 0, 8, 3.5, 0, 0, 1);
  cv::Mat1b fine, picture;
  cv::warpPerspective(board, fine, finer * view.pixel_from_board * board_from_drawing,
                      {8 * width, 8 * height}, cv::INTER_LINEAR, cv::BORDER_CONSTANT, 200);
  cv::resize(fine, picture, {width, height}, 0, 0, cv::INTER_AREA);
  cv::GaussianBlur(picture, picture, {}, 0.7);
  cv::Mat noisy(height, width, CV_16S);
  random.fill(noisy, cv::RNG::NORMAL, 0, 1.5);
  cv::add(picture, noisy, picture, {}, CV_8U);
  view.frame.format = PixelFormat::gray8;
  view.frame.width = width;
  view.frame.height = height;
  view.frame.bytes.assign(picture.datastart, picture.dataend);
  return view;
}

// 0.3 px and 0.2 % are the promised bounds of the form with squares.
TEST(BoardFinder, KalibrsAprilgridGivesTheLens) {
  const Board board = parse_board("aprilgrid:6x6:88mm:26.4mm");
  for (const bool has_squares : {true, false}) {
    const cv::Mat1b drawing = kalibr_board(has_squares);
    cv::RNG random(3);
    Views views{width, height, {}};
    const auto finder = make_board_finder(board, {});
    std::size_t found = 0;
    double largest = 0;
    for (int i = 0; i < 14; ++i) {
      const KalibrView truth = kalibr_view(drawing, random);
      const BoardCorners corners = finder->find(truth.frame);
      View view{std::to_string(i), {}, corners.pixels};
      for (std::size_t k = 0; k < corners.ids.size(); ++k) {
        const glm::dvec3& point = board.points[std::size_t(corners.ids[k])];
        view.points.push_back(point);
        const cv::Vec3d at = truth.pixel_from_board * cv::Vec3d(point.x, point.y, 1);
        largest = std::max(
            largest, glm::distance(corners.pixels[k], glm::dvec2(at[0] / at[2], at[1] / at[2])));
      }
      found += corners.ids.size();
      if (!view.points.empty()) views.views.push_back(std::move(view));
    }
    SCOPED_TRACE(finder->form() + ": " + std::to_string(found) + " corners");
    EXPECT_NE(finder->form().find("border of two cells"), std::string::npos);
    EXPECT_EQ(finder->form().find(", no squares") == std::string::npos, has_squares);
    EXPECT_GT(found, 14u * 144u * 9 / 10);
    // Without squares the edges' own refinement is used, which leaves single corners to
    // fit_observer.
    if (!has_squares) continue;
    EXPECT_LT(largest, 0.3);
    EXPECT_NEAR(fit_observer(views).intrinsics.fx, 620, 0.002 * 620);
  }
}

}  // namespace calibrate_board_test
}  // namespace previz::calibrate
