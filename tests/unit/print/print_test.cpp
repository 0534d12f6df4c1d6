// What `previz print` draws, rasterised as a printer would: ids, sizes and places in millimetres.
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/tracking/tag_detector.hpp"
#include "daemon/tools/calibrate/lens/board_finder.hpp"
#include "daemon/tools/print/boards.hpp"
#include "daemon/tools/print/pdf.hpp"
#include "daemon/tools/print/print.hpp"
#include "daemon/tools/print/tag_cells.hpp"
#include "daemon/tools/print/tags.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/support/tracking_synthetic.hpp"

namespace previz::print::print_test {

// A raster of so many dots an inch, as an office printer's half: a pixel is 0.17 mm.
constexpr double dots_per_inch = 150;
constexpr double px_per_mm = dots_per_inch / 25.4;

// (0,0) is the centre of the upper left pixel.
glm::dvec2 mm_of(const glm::dvec2& pixel) {
  return (pixel + 0.5) / px_per_mm;
}

// Returns the pages of a PDF, gray.
std::vector<Frame> pages_of(const std::filesystem::path& pdf) {
  const std::string prefix = (pdf.parent_path() / "page").string();
  const std::string command = "pdftocairo -png -gray -r " + std::to_string(int(dots_per_inch)) +
                              " '" + pdf.string() + "' '" + prefix + "'";
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(pdf.parent_path()))
    if (entry.path().extension() == ".png") files.push_back(entry.path());
  std::ranges::sort(files);
  std::vector<Frame> pages;
  for (const std::filesystem::path& file : files) {
    const cv::Mat picture = cv::imread(file.string(), cv::IMREAD_GRAYSCALE);
    pages.push_back(
        test::gray_frame(picture.cols, picture.rows, {picture.datastart, picture.dataend}));
    std::filesystem::remove(file);
  }
  return pages;
}

std::vector<tracking::TagDetection> tags_in(const Frame& page, const std::string& family) {
  const PinholeIntrinsics flat = test::plain_lens(page.width, page.height, page.width);
  tracking::DetectorSettings settings;
  settings.family = family;
  settings.max_hamming = 0;
  return tracking::TagDetector(settings, flat, test::linear_response).detect(page, 1);
}

double side_mm(const tracking::TagDetection& tag, std::size_t side) {
  return glm::distance(tag.corners[side], tag.corners[(side + 1) % 4]) / px_per_mm;
}

class Print : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("pdftocairo -v >/dev/null 2>&1") != 0)
      GTEST_SKIP() << "pdftocairo is not there; Debian has it in poppler-utils";
  }
  std::vector<Frame> pages(const std::vector<Drawing>& drawings, const std::string& paper) {
    sheets = lay_out(drawings, paper_by_name(paper), "what it is");
    const std::filesystem::path file = folder / "sheet.pdf";
    session::replace_file(file, pdf_of(drawings, sheets, "test"));
    return pages_of(file);
  }

  test::TemporaryDirectory folder;
  std::vector<Sheet> sheets;
};

// Every family that libapriltag has: the tag is found where the sheet has it, as large as was asked
// for. A rasteriser paints every pixel that a shape touches, so that an edge may be a pixel out,
// and the distance of two edges two.
TEST_F(Print, TagsOfEveryFamilyAreFoundAtTrueSize) {
  for (const char* family :
       {"tag36h11", "tag25h9", "tag16h5", "tag36h10", "tagStandard41h12", "tagStandard52h13",
        "tagCircle21h7", "tagCircle49h12", "tagCustom48h12"}) {
    SCOPED_TRACE(family);
    const TagSheet asked{family, {0, 7, 29}, 30};
    const std::vector<Drawing> drawings = draw_tags(asked);
    const auto found = pages(drawings, "A4");
    ASSERT_EQ(found.size(), 1u);
    EXPECT_NEAR(std::max(found[0].width, found[0].height), 297 * px_per_mm, 1);
    const auto tags = tags_in(found[0], family);
    ASSERT_EQ(tags.size(), 3u);
    const FamilyShape shape = family_shape(family);
    const double inset = (1 + (shape.total - shape.border) / 2.0) * 30 / shape.border;
    for (std::size_t i = 0; i < tags.size(); ++i) {
      EXPECT_EQ(tags[i].id, asked.ids[i]);
      for (std::size_t side = 0; side < 4; ++side)
        EXPECT_NEAR(side_mm(tags[i], side), 30, 2 / px_per_mm);
      const glm::dvec2 upper_left = mm_of(tags[i].corners[3]);
      EXPECT_NEAR(upper_left.x, sheets[0].placed[i].x + inset, 1 / px_per_mm);
      EXPECT_NEAR(upper_left.y, sheets[0].placed[i].y + inset, 1 / px_per_mm);
    }
  }
}

TEST_F(Print, ManyTagsTakeSeveralSheetsOfAnyPaper) {
  TagSheet asked;
  asked.size_mm = 60;
  for (int id = 0; id < 12; ++id) asked.ids.push_back(id);
  for (const char* paper : {"A3", "Letter"}) {  // A4: the other cases
    SCOPED_TRACE(paper);
    std::vector<int> ids;
    for (const Frame& page : pages(draw_tags(asked), paper))
      for (const auto& tag : tags_in(page, asked.family)) ids.push_back(tag.id);
    EXPECT_EQ(ids, asked.ids);
  }
  EXPECT_EQ(sheets.front().title, "what it is; sheet 1 of 3");
}

TEST_F(Print, ABlockHasATagASide) {
  const TagSheet asked{"tag36h11", {3, 4, 5, 6, 7, 8}, 30};
  const auto found = pages({draw_block(asked)}, "A4");
  ASSERT_EQ(found.size(), 1u);
  std::map<int, glm::dvec2> centres;
  for (const auto& tag : tags_in(found[0], "tag36h11"))
    centres[tag.id] = mm_of((tag.corners[0] + tag.corners[2]) / 2.0);
  ASSERT_EQ(centres.size(), 6u);
  const double face = face_mm(asked);
  for (int side = 1; side < 4; ++side)
    EXPECT_NEAR(glm::distance(centres[3 + side], centres[3] + glm::dvec2(side * face, 0)), 0,
                1 / px_per_mm);
  EXPECT_NEAR(glm::distance(centres[7], centres[4] - glm::dvec2(0, face)), 0, 1 / px_per_mm);
  EXPECT_NEAR(glm::distance(centres[8], centres[4] + glm::dvec2(0, face)), 0, 1 / px_per_mm);
}

TEST_F(Print, AStickHasFourTagsAround) {
  const TagSheet asked{"tag36h11", {0, 1, 2, 3, 10, 11, 12, 13}, 25};
  const auto found = pages({draw_stick(asked)}, "A4");
  ASSERT_EQ(found.size(), 1u);
  std::vector<int> ids;
  for (const auto& tag : tags_in(found[0], "tag36h11")) ids.push_back(tag.id);
  EXPECT_EQ(ids, asked.ids);
}

// Every point of the board is found, at its distance from the first one to a pixel.
void expect_board(const Frame& page, const std::string& text) {
  const calibrate::Board board = calibrate::parse_board(text);
  const calibrate::KnownLens lens = test::plain_lens(page.width, page.height, page.width);
  const auto found = calibrate::make_board_finder(board, test::linear_response, lens)->find(page);
  ASSERT_EQ(found.ids.size(), board.points.size()) << text;
  for (std::size_t i = 1; i < found.ids.size(); ++i) {
    const glm::dvec3 at =
        board.points[std::size_t(found.ids[i])] - board.points[std::size_t(found.ids[0])];
    EXPECT_NEAR(glm::distance(found.pixels[i], found.pixels[0]) / px_per_mm, 1000 * glm::length(at),
                1 / px_per_mm)
        << text << " point " << found.ids[i];
  }
}

TEST_F(Print, BoardsAreFoundAtTrueSize) {
  for (const char* text :
       {"chessboard:9x6:25mm", "chessboard:6x9:20mm", "charuco:7x5:30mm:22mm:5x5_100",
        "charuco:6x8:1in:0.75in:4x4_50", "aprilgrid:4x3:40mm:12mm",
        "aprilgrid:3x3:40mm:12mm:tag25h9:4", "aprilgrid:4x3:40mm:12mm:kalibr:5"}) {
    const auto found = pages({draw_board(calibrate::parse_board(text), text)}, "A4");
    ASSERT_EQ(found.size(), 1u) << text;
    expect_board(found[0], text);
  }
}

// Kalibr's form: a tag's border is black over two of its ten cells, and a square touches each of
// its corners. It is recognised by a finder that was not told of it.
TEST_F(Print, KalibrsBoardHasItsForm) {
  const std::string plain = "aprilgrid:4x3:40mm:12mm", text = plain + ":kalibr";
  const auto found = pages({draw_board(calibrate::parse_board(text), text)}, "A4");
  ASSERT_EQ(found.size(), 1u);
  expect_board(found[0], plain);
  const auto finder =
      calibrate::make_board_finder(calibrate::parse_board(plain), test::linear_response);
  EXPECT_EQ(finder->find(found[0]).ids.size(), 4u * 12u);
  EXPECT_EQ(finder->form(), "the tags have a black border of two cells, squares at the corners");
}

// The tiles of a board that is larger than the paper, cut at the marks and put together.
TEST_F(Print, WhatIsLargerThanThePaperIsCutIntoTiles) {
  const char* text = "chessboard:9x6:40mm";
  const Drawing drawing = draw_board(calibrate::parse_board(text), text);
  const auto found = pages({drawing}, "A4");
  ASSERT_EQ(found.size(), 4u);
  Frame whole = test::gray_frame(int(drawing.width * px_per_mm), int(drawing.height * px_per_mm));
  std::ranges::fill(whole.bytes, std::uint8_t{255});
  for (std::size_t page = 0; page < found.size(); ++page) {
    const Placed& placed = sheets[page].placed[0];
    const Rectangle& window = placed.window;
    for (int y = 0; y < whole.height; ++y)
      for (int x = 0; x < whole.width; ++x) {
        const double on_x = placed.x + (x + 0.5) / px_per_mm;
        const double on_y = placed.y + (y + 0.5) / px_per_mm;
        if (on_x < window.x || on_y < window.y || on_x >= window.x + window.width ||
            on_y >= window.y + window.height)
          continue;
        const int px = int(on_x * px_per_mm), py = int(on_y * px_per_mm);
        whole.bytes[std::size_t(y * whole.width + x)] =
            found[page].bytes[std::size_t(py * found[page].width + px)];
      }
  }
  expect_board(whole, text);
  EXPECT_EQ(sheets[3].title, std::string(text) + "; column 2 of 2, row 2 of 2");
}

// The ruler's first and last tick are 100 mm apart on paper.
TEST_F(Print, TheRulerIsAsLongAsItSays) {
  const auto found = pages(draw_tags({"tag36h11", {0}, 50}), "A4");
  const Frame& page = found.at(0);
  const double y_mm = 297 - sheet_margin_mm - 4.5 - 3.6;  // only the ticks of whole centimetres
  const int row = int(y_mm * px_per_mm);
  std::vector<double> ticks;
  for (int x = 0; x < int((sheet_margin_mm + ruler_mm + 2) * px_per_mm); ++x)
    if (page.bytes[std::size_t(row * page.width + x)] < 250 &&
        (ticks.empty() || x / px_per_mm - ticks.back() > 2))
      ticks.push_back(x / px_per_mm);
  ASSERT_EQ(ticks.size(), 11u);
  EXPECT_NEAR(ticks.back() - ticks.front(), 100, 1 / px_per_mm);
}

TEST(PrintRefusals, SayWhatIsPossible) {
  struct Asked {
    const char *ids, *size, *family, *paper, *words;
  };
  std::ostringstream out;
  TagOptions tags;
  for (const auto& [ids, size, family, paper, words] : {
           Asked{"0-3", "80", "tag36h11", "A4", "size \"80\""},
           Asked{"0-3", "1mm", "tag36h11", "A4", "needs 3.2 mm or more"},
           Asked{"3-1", "80mm", "tag36h11", "A4", "ids \"3-1\""},
           Asked{"587", "80mm", "tag36h11", "A4", "it has 0 to 586"},
           Asked{"0", "80mm", "tag99", "A4", "known: tag36h11"},
           Asked{"0", "80mm", "tag36h11", "A5", "known: A4, A3, Letter"},
           Asked{"0", "3m", "tag36h11", "A4", "sheets of A4; at most 64"},
       }) {
    tags.ids = ids, tags.size = size, tags.family = family, tags.paper = paper;
    EXPECT_THAT(test::error_of([&] { print_tags(tags, out); }), HasSubstr(words));
  }
  tags.size = "80mm", tags.ids = "1,2,3";
  EXPECT_THAT(test::error_of([&] { print_block(tags, out); }), HasSubstr("5 or 6 tags"));
  EXPECT_THAT(test::error_of([&] { print_stick(tags, out); }), HasSubstr("rings of four tags"));
  BoardOptions board;
  for (const auto& [text, words] : {
           std::pair{"charuco:7x5:30mm:22mm:9x9_100", "not a marker dictionary"},
           {"aprilgrid:3x3:40mm:5mm:tagStandard41h12", "gap of 32 mm or more"},
           {"aprilgrid:3x3:40mm:7mm:kalibr", "gap of 8 mm or more"},  // a cell of 4 mm about each
       }) {
    board.board = text;
    EXPECT_THAT(test::error_of([&] { print_board(board, out); }), HasSubstr(words));
  }
}

TEST(PrintReport, SaysWhatIsInTheFile) {
  const test::TemporaryDirectory folder;
  TagOptions tags;
  tags.ids = "0-11", tags.size = "80mm", tags.file = folder / "tags.pdf";
  std::ostringstream out;
  print_tags(tags, out);
  EXPECT_THAT(out.str(), HasSubstr("tags.pdf: 12 tags tag36h11 0-11, 80 mm, on 6 sheets of A4\n"));
  EXPECT_THAT(test::content_of(tags.file), StartsWith("%PDF-"));
}

}  // namespace previz::print::print_test
