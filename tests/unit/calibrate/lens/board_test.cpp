// Boards as they are written, and found in pictures whose corners are known exactly.
#include <opencv2/imgproc.hpp>

#include "daemon/tools/calibrate/lens/board.hpp"
#include "daemon/tools/calibrate/lens/board_finder.hpp"
#include "daemon/tools/calibrate/lens/board_guess.hpp"
#include "daemon/tools/calibrate/lens/marker_dictionary.hpp"
#include "tests/support/test.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::calibrate::board_test {

std::string problem(const std::string& text) {
  return test::error_of([&] { parse_board(text); });
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
  EXPECT_FALSE(parse_board("aprilgrid:6x5:88mm:26mm").is_kalibr);
  const Board kalibr = parse_board("aprilgrid:6x5:88mm:26mm:kalibr:4");
  EXPECT_TRUE(kalibr.is_kalibr);
  EXPECT_EQ(kalibr.dictionary, "tag36h11");
  EXPECT_EQ(kalibr.first_id, 4);
}

TEST(Board, EveryMistakeIsNamed) {
  EXPECT_THAT(problem("checkers:9x6:25mm"), HasSubstr("kind \"checkers\""));
  EXPECT_THAT(problem("chessboard:9:25mm"), HasSubstr("size \"9\""));
  EXPECT_THAT(problem("chessboard:9x2:25mm"), HasSubstr("rows \"2\""));
  EXPECT_THAT(problem("chessboard:9x6"), HasSubstr("no square"));
  EXPECT_THAT(problem("chessboard:9x6:25"), HasSubstr("square \"25\""));
  EXPECT_THAT(problem("chessboard:9x6:-25mm"), HasSubstr("square \"-25mm\""));
  EXPECT_THAT(problem("chessboard:9x6:25mm:3"), HasSubstr("an extra field \"3\""));
  EXPECT_THAT(problem("charuco:5x5:20mm:20mm:4x4_50"), HasSubstr("needs markers smaller"));
  EXPECT_THAT(problem("chessboard:9x6:25mm:3"), HasSubstr(board_grammar));
}

TEST(Board, UnknownDictionariesAndFamiliesAreNamed) {
  EXPECT_THROW(make_board_finder(parse_board("charuco:5x5:20mm:15mm:8x8_50"), {}), Error);
  EXPECT_THROW(make_board_finder(parse_board("charuco:20x20:20mm:15mm:4x4_50"), {}), Error);
  EXPECT_THAT(problem("aprilgrid:6x6:24mm:7mm:tag99h9"), HasSubstr("family \"tag99h9\""));
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
Frame chessboard(int columns, int rows, double square_m, double blur_px = 0.7) {
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
  cv::GaussianBlur(pixels, pixels, {}, blur_px);
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
  Frame frame = test::gray_frame(160, 120);
  std::mt19937 random(3);
  for (std::uint8_t& byte : frame.bytes) byte = std::uint8_t(random());
  for (const char* text :
       {"chessboard:9x6:25mm", "charuco:5x5:20mm:15mm:4x4_50", "aprilgrid:3x3:88mm:26mm"})
    EXPECT_TRUE(make_board_finder(parse_board(text), {})->find(frame).ids.empty()) << text;
}

// OpenCV's own drawing of the board, enlarged by whole pixels: its corner (i, j) lies between
// pixels, at (i + 1, j + 1) squares - 0.5. There is no noise; the bound is that of the bias above.
Frame charuco_drawing() {
  const auto drawing =
      charuco_board(7, 5, 0.04f, 0.03f, markers_of(parse_board("charuco:7x5:40mm:30mm:4x4_50")));
  cv::Mat1b picture;
#if CV_VERSION_MINOR >= 7
  drawing->generateImage({560, 400}, picture, 0, 1);
#else
  drawing->draw({560, 400}, picture, 0, 1);
#endif
  cv::GaussianBlur(picture, picture, {}, 0.7);
  cv::copyMakeBorder(picture, picture, 40, 40, 40, 40, cv::BORDER_CONSTANT, 255);
  return test::gray_frame(picture.cols, picture.rows, {picture.datastart, picture.dataend});
}

TEST(BoardFinder, CharucoCornersHaveTheirIds) {
  const Board board = parse_board("charuco:7x5:40mm:30mm:4x4_50");
  const BoardCorners found = make_board_finder(board, {})->find(charuco_drawing());
  ASSERT_EQ(found.ids.size(), 24u);
  for (std::size_t i = 0; i < 24; ++i) {
    const int column = found.ids[i] % 6, row = found.ids[i] / 6;
    const glm::dvec2 truth(40 + 80 * (column + 1) - 0.5, 40 + 80 * (row + 1) - 0.5);
    EXPECT_LT(glm::distance(found.pixels[i], truth), 0.05) << found.ids[i];
  }
}

test::TagScene six_tags() {
  test::TagScene scene;
  scene.lens = test::plain_lens(width, height, 600);
  scene.world_from_camera = test::camera_looking({0.1, -0.2, 0.45}, {0.11, 0.07, 0});
  for (int i = 0; i < 6; ++i) {
    const int column = i % 3, row = i / 3;
    scene.tags.push_back(test::flat_tag(7 + i, 0.06, {0.03 + 0.08 * column, 0.03 + 0.08 * row, 0}));
  }
  return scene;
}

Frame picture_of(const test::TagScene& scene) {
  std::mt19937 random(1);
  return test::expose(test::render(scene), {.full_well_e = 20000, .response = {}}, random);
}

TEST(BoardFinder, AprilgridCornersHaveTheirIds) {
  const Board board = parse_board("aprilgrid:3x2:60mm:20mm:tag36h11:7");
  const test::TagScene scene = six_tags();
  const Frame frame = picture_of(scene);
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

std::string other(const Frame& picture, const std::string& named) {
  return other_board({std::make_shared<const Frame>(picture)}, parse_board(named), {});
}

TEST(OtherBoard, AChessboardIsCountedByItsInnerCorners) {
  const Frame picture = chessboard(9, 6, 0.025);
  const std::string right =
      "the pictures hold a chessboard of 9x6 inner corners (10x7 squares): --board "
      "chessboard:9x6:25mm";
  // Counted in squares; a row too many or too few; a part of it.
  for (const char* named : {"10x7", "9x7", "8x6", "8x5", "4x3", "11x8"})
    EXPECT_EQ(other(picture, std::string("chessboard:") + named + ":25mm"), right) << named;
  EXPECT_EQ(other(picture, "chessboard:9x6:25mm"), "");
  EXPECT_EQ(other(picture, "chessboard:6x9:25mm"), "");
}

// Squares of 600 / 0.42 * 9.8 mm = 14 px and of 18 px, blurred as by a lens out of focus.
TEST(OtherBoard, ASoftChessboardOfSmallSquaresIsCounted) {
  for (const double square_m : {0.0098, 0.0126})
    for (const double blur_px : {1.5, 2.5})
      for (const char* named : {"10x7", "8x5", "4x3"})
        EXPECT_THAT(other(chessboard(9, 6, square_m, blur_px),
                          std::string("chessboard:") + named + ":10mm"),
                    HasSubstr("a chessboard of 9x6 inner corners"))
            << square_m << ' ' << blur_px << ' ' << named;
}

TEST(OtherBoard, MarkersAreNamedByTheirDictionary) {
  EXPECT_THAT(other(charuco_drawing(), "charuco:7x5:40mm:30mm:6x6_250"),
              HasSubstr("markers of 4x4_50 (ids 0 to 16)"));
  EXPECT_THAT(other(charuco_drawing(), "charuco:5x4:40mm:30mm:4x4_50"),
              HasSubstr("such a board has 33 squares at least"));
  // Three tags that look like markers of 4x4_1000 here and there are no board of it.
  EXPECT_EQ(other(picture_of(six_tags()), "charuco:7x5:40mm:30mm:6x6_250"), "");
}

TEST(OtherBoard, TagsAreNamedByTheirFamilyAndIds) {
  const Frame picture = picture_of(six_tags());
  EXPECT_THAT(other(picture, "aprilgrid:3x2:60mm:20mm:tag25h9"),
              HasSubstr("tags of tag36h11, ids 7 to 12: name that family"));
  EXPECT_THAT(other(picture, "aprilgrid:3x2:60mm:20mm"),
              HasSubstr("aprilgrid:COLUMNSxROWS:TAG:GAP:tag36h11:7"));
  EXPECT_THAT(other(picture, "aprilgrid:3x2:60mm:20mm:kalibr:7"),
              HasSubstr("remove the word kalibr"));
  EXPECT_EQ(other(picture, "aprilgrid:3x2:60mm:20mm:tag36h11:7"), "");
}

}  // namespace previz::calibrate::board_test
