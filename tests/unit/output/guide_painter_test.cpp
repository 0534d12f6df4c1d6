// Lines over a picture as tiles: where they lie on the screen, and that they are few.
#include "daemon/core/output/guide_painter.hpp"

#include "tests/support/test.hpp"

namespace previz::output::guide_painter_test {

using Pixel = std::array<int, 4>;

GuidePage page_of(std::vector<GuideLine> lines, int width = 960, int height = 540) {
  return {width, height, std::move(lines), {}};
}

// What lies over a pixel of the screen.
Pixel at(const std::vector<Overlay>& tiles, int x, int y) {
  for (const Overlay& tile : tiles) {
    if (x < tile.x || y < tile.y || x >= tile.x + tile.width || y >= tile.y + tile.height) continue;
    const std::uint8_t* rgba =
        &tile.rgba[4 * static_cast<std::size_t>((y - tile.y) * tile.width + x - tile.x)];
    return {rgba[0], rgba[1], rgba[2], rgba[3]};
  }
  return {};
}

TEST(GuidePainter, OfNothingThereAreNoTiles) {
  EXPECT_TRUE(
      GuidePainter(1920, 1080, DisplayScale::letterbox).paint(page_of({}), 960, 540).empty());
}

// A picture of half the screen's size: the centre of its pixel (100, 200) is at 200.5, 400.5 in the
// screen's, so that a line of 2 px covers the rows 400 and 401.
TEST(GuidePainter, ALineIsTwoPixelsWideWithADarkBorder) {
  const auto tiles = GuidePainter(1920, 1080, DisplayScale::letterbox)
                         .paint(page_of({{{100, 200}, {140, 200}, GuideKind::x_axis}}), 960, 540);
  const Pixel red{255, 60, 50, 255};
  EXPECT_EQ(at(tiles, 240, 400), red);
  EXPECT_EQ(at(tiles, 240, 401), red);
  for (const int y : {399, 402}) EXPECT_EQ(at(tiles, 240, y), (Pixel{0, 0, 0, 128}));
  for (const int y : {397, 404}) EXPECT_EQ(at(tiles, 240, y), Pixel{});
  EXPECT_EQ(at(tiles, 190, 400), Pixel{});
  EXPECT_EQ(at(tiles, 292, 400), Pixel{});
}

// The page is of another size than the picture: a preview is rendered in fewer pixels.
TEST(GuidePainter, APageFitsAPictureOfAnySize) {
  const GuidePainter painter(1920, 1080, DisplayScale::letterbox);
  const GuidePage page = page_of({{{100, 200}, {140, 220}}});
  const auto whole = painter.paint(page, 960, 540), half = painter.paint(page, 480, 270);
  ASSERT_EQ(whole.size(), half.size());
  for (std::size_t i = 0; i < whole.size(); ++i) EXPECT_EQ(whole[i].rgba, half[i].rgba);
}

TEST(GuidePainter, NothingIsDrawnBesideThePicture) {
  // 4:3 in 16:9: the picture begins at (1920 - 1440) / 2 = 240.
  const auto tiles =
      GuidePainter(1920, 1080, DisplayScale::letterbox)
          .paint(page_of({{{-40, 240}, {40, 240}}, {{600, 240}, {700, 240}}}, 640, 480), 640, 480);
  EXPECT_EQ(at(tiles, 239, 541), Pixel{});
  EXPECT_GT(at(tiles, 240, 541)[3], 0);
  EXPECT_GT(at(tiles, 1679, 541)[3], 0);
  EXPECT_EQ(at(tiles, 1680, 541), Pixel{});
}

// 1:1, twice as large as the screen: what is in its middle quarter is seen.
TEST(GuidePainter, OfAPictureThatIsCutOffTheMiddleIsSeen) {
  const auto tiles =
      GuidePainter(960, 540, DisplayScale::one_to_one)
          .paint(page_of({{{960, 300}, {980, 300}}, {{10, 10}, {40, 10}}}, 1920, 1080), 1920, 1080);
  ASSERT_EQ(tiles.size(), 1u);
  EXPECT_GT(at(tiles, 490, 30)[1], 200);  // 300 - 270
}

TEST(GuidePainter, TilesAreFewApartAndPremultiplied) {
  GuidePage page = page_of({{{0, 0}, {959, 539}, GuideKind::bounds}, {{0, 539}, {959, 3}}});
  page.words = {{{480, 100}, "12", GuideKind::tag}};
  const auto tiles = GuidePainter(1920, 1080, DisplayScale::letterbox).paint(page, 960, 540);
  // A tile is 64 px wide: each diagonal passes 30 columns and 17 rows of them.
  EXPECT_LE(tiles.size(), 2u * (30 + 17) + 4);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    const Overlay& tile = tiles[i];
    EXPECT_TRUE(tile.x >= 0 && tile.y >= 0 && tile.x + tile.width <= 1920 &&
                tile.y + tile.height <= 1080);
    for (std::size_t p = 0; p < tile.rgba.size(); p += 4)
      for (std::size_t c = 0; c < 3; ++c) ASSERT_LE(tile.rgba[p + c], tile.rgba[p + 3] + 1);
    for (std::size_t j = 0; j < i; ++j)
      EXPECT_TRUE(tile.x != tiles[j].x || tile.y != tiles[j].y) << i << ' ' << j;
  }
}

TEST(GuidePainter, WordsAreAroundTheirPlace) {
  GuidePage page = page_of({});
  page.words = {{{480, 270}, "HHH", GuideKind::focus}};
  const auto tiles = GuidePainter(1920, 1080, DisplayScale::letterbox).paint(page, 960, 540);
  int ink = 0;
  for (int x = 920; x < 1000; ++x) ink += at(tiles, x, 540)[0] > 200;
  EXPECT_GT(ink, 6);
  EXPECT_EQ(at(tiles, 480, 270), Pixel{});
}

}  // namespace previz::output::guide_painter_test
