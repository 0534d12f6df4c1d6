// Videos and photographs of others: which side is up, the shape of a pixel, and what is refused.
#include <opencv2/imgproc.hpp>

#include "tests/support/import_fixture.hpp"

namespace previz::exchange::import_video_test {

// Its quadrants are red, green, blue and white.
Bytes marked_picture(int width, int height) {
  constexpr std::array<std::array<std::uint8_t, 3>, 4> colors = {
      {{200, 0, 0}, {0, 200, 0}, {0, 0, 200}, {200, 200, 200}}};
  Bytes bytes;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (const std::uint8_t sample :
           colors[static_cast<std::size_t>(2 * (2 * y >= height) + (2 * x >= width))])
        bytes.push_back(sample);
  return bytes;
}

int quadrant_at(const Frame& frame, int x, int y) {
  const std::uint8_t* rgb =
      frame.bytes.data() +
      3 * (static_cast<std::size_t>(y) * std::size_t(frame.width) + std::size_t(x));
  return rgb[0] > 100 ? (rgb[1] > 100 ? 3 : 0) : rgb[1] > 100 ? 1 : 2;
}

const VideoForm marked_form = {.width = 48, .encoder = "png"};

// All eight, by the definition in libavutil/display.h: a point (p, q) of the stored picture is
// shown at (a p + c q, b p + d q), up to a shift; the rows of the matrix begin with (a, b) and (c,
// d).
TEST(ImportVideo, IsTurnedAsItIsToBeShown) {
  for (const auto& [a, b, c, d] :
       {std::array{1, 0, 0, 1}, std::array{-1, 0, 0, -1}, std::array{0, 1, -1, 0},
        std::array{0, -1, 1, 0}, std::array{-1, 0, 0, 1}, std::array{1, 0, 0, -1},
        std::array{0, 1, 1, 0}, std::array{0, -1, -1, 0}}) {
    VideoForm form = marked_form;
    const int one = 1 << 16;
    form.display_matrix = {a * one, b * one, 0, c * one, d * one, 0, 0, 0, 1 << 30};
    Shoot shoot;
    shoot.film("take.mov", form, {marked_picture(48, 16)});
    const ImportReport report = shoot.import();
    const bool upright = a == 1 && d == 1;
    EXPECT_EQ(report.notes.size(), upright ? 1u : 2u);
    const FramePtr frame = shoot.open()->read(0);
    ASSERT_EQ(frame->width, a == 0 ? 16 : 48);
    ASSERT_EQ(frame->height, a == 0 ? 48 : 16);
    for (int stored = 0; stored < 4; ++stored) {
      const int p = stored % 2 ? 12 : -12, q = stored / 2 ? 4 : -4;  // from the centre
      EXPECT_EQ(
          quadrant_at(*frame, frame->width / 2 + a * p + c * q, frame->height / 2 + b * p + d * q),
          stored)
          << a << b << c << d;
    }
  }
}

TEST(ImportVideo, AnAngleThatIsNoQuarterTurnIsRefused) {
  VideoForm form = marked_form;
  form.display_matrix = {46341, 46341, 0, -46341, 46341, 0, 0, 0, 1 << 30};
  Shoot shoot;
  shoot.film("take.mov", form, {marked_picture(48, 16)});
  EXPECT_THAT(shoot.error(), HasSubstr("\"rotation_deg\": 0"));
  shoot.json["observer"]["read_as"] = {{"rotation_deg", 45}};
  EXPECT_THAT(shoot.error(), HasSubstr("must be 0, 90, 180 or 270"));
  shoot.json["observer"]["read_as"] = {{"rotation_deg", 0}};
  EXPECT_EQ(shoot.error(), "");
  EXPECT_EQ(shoot.open()->read(0)->width, 48);
}

TEST(ImportVideo, PixelsBecomeSquare) {
  struct Case {
    AVRational aspect;
    int width, height;
  };
  for (const Case& shape : {Case{{1, 1}, 48, 16}, Case{{2, 1}, 96, 16}, Case{{4, 3}, 64, 16},
                            Case{{1, 2}, 48, 32}, Case{{0, 1}, 48, 16}}) {
    VideoForm form = marked_form;
    form.pixel_aspect = shape.aspect;
    Shoot shoot;
    shoot.film("take.mov", form, {marked_picture(48, 16)});
    const FramePtr frame = shoot.first_frame();
    ASSERT_EQ(frame->width, shape.width);
    ASSERT_EQ(frame->height, shape.height);
    for (int i = 0; i < 4; ++i)
      EXPECT_EQ(quadrant_at(*frame, frame->width * (i % 2 ? 3 : 1) / 4,
                            frame->height * (i / 2 ? 3 : 1) / 4),
                i);
    // Two more quadrants' edges: nothing is shifted by making the pixels square.
    EXPECT_EQ(quadrant_at(*frame, frame->width / 2 - 2, 1), 0);
    EXPECT_EQ(quadrant_at(*frame, frame->width / 2 + 1, 1), 1);
  }
}

// A JPEG's APP1 segment of EXIF data with nothing but the orientation (Exif 2.32, 4.6.2).
std::string exif_segment(int orientation) {
  const std::string tiff("II*\0\10\0\0\0\1\0\x12\1\3\0\1\0\0\0", 18);
  return std::string("\xff\xe1\0\x22", 4) + std::string("Exif\0\0", 6) + tiff +
         static_cast<char>(orientation) + std::string(7, '\0');
}

// Exif 2.32, 4.6.4: of the stored picture's quadrants red, green, blue and white, which is seen at
// the top left and which at the top right.
TEST(ImportPictures, AreTurnedAsEXIFSays) {
  constexpr std::array<std::array<int, 2>, 8> top = {
      {{0, 1}, {1, 0}, {3, 2}, {2, 3}, {0, 2}, {2, 0}, {3, 1}, {1, 3}}};
  for (int orientation = 1; orientation <= 8; ++orientation) {
    Shoot shoot;
    const Bytes marked = marked_picture(64, 32);
    cv::Mat rgb(32, 64, CV_8UC3, const_cast<std::uint8_t*>(marked.data())), bgr;
    cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
    const std::filesystem::path file = shoot.folder() / "photo.jpg";
    write_picture(file, bgr);
    std::string bytes = session::content_of(file);
    session::write_content(file, bytes.insert(2, exif_segment(orientation)));
    shoot.json["observer"] = {{"pictures", {"photo.jpg"}}, {"fps", 25}, {"exposure", 1}};
    const ImportReport report = shoot.import();
    EXPECT_EQ(report.notes.empty(), orientation == 1);
    const FramePtr frame = shoot.open()->read(0);
    EXPECT_EQ(frame->width, orientation > 4 ? 32 : 64);
    const auto [left, right] = top[static_cast<std::size_t>(orientation - 1)];
    EXPECT_EQ(quadrant_at(*frame, 8, 8), left) << orientation;
    EXPECT_EQ(quadrant_at(*frame, frame->width - 8, 8), right) << orientation;
  }
}

// ------------------------------------------------------------ what is refused

TEST(ImportVideo, WhatIsNotConvertedIsRefusedWithARemedy) {
  struct Case {
    AVColorSpace matrix;
    const char *named, *read_as;
  };
  for (const auto& [matrix, named, read_as] :
       {Case{AVCOL_SPC_YCGCO, "matrix ycgco", "bt709"},
        Case{AVCOL_SPC_BT2020_CL, "matrix bt2020c", "bt2020"}}) {
    Shoot shoot;
    shoot.film("take.mkv", {.pixel_format = "yuv420p", .matrix = matrix},
               {Bytes(32 * 16 * 3 / 2, 100)});
    EXPECT_THAT(shoot.error(),
                AllOf(HasSubstr(named), HasSubstr("zscale=matrix=709"), HasSubstr("read_as")));
    shoot.json["observer"]["read_as"] = {{"matrix", read_as}};
    EXPECT_EQ(shoot.error(), "");
  }
}

// A frame of VideoForm's size and pixel format.
Bytes noise() {
  return frame_bytes_of(noise_picture(1, CV_8UC3, 32, 16));
}

// Cameras name their curves in words.
TEST(ImportVideo, ACamerasLogarithmicCurveIsRefused) {
  VideoForm form = {.encoder = "png", .metadata = {{"GAMMA", "S-Log3"}}};
  Shoot shoot;
  shoot.film("take.mkv", form, {noise()});
  EXPECT_THAT(shoot.error(), HasSubstr("logarithmic curve: its GAMMA is \"S-Log3\""));
  shoot.json["observer"]["read_as"] = {{"transfer", "as recorded"}};
  const ImportReport report = shoot.import();
  EXPECT_EQ(shoot.open()->read(0)->bytes, noise());
  EXPECT_THAT(report.notes.at(0), HasSubstr("as recorded"));

  form.metadata = {{"comment", "graded from S-Log3"}};  // people's words
  Shoot commented;
  commented.film("take.mkv", form, {noise()});
  EXPECT_EQ(commented.error(), "");
}

// Some programs write the number 0, which is the matrix of RGB and else reserved, for "unknown".
TEST(ImportVideo, NoughtsInPlaceOfColoursSayNothing) {
  Shoot shoot;
  for (const char* encoder : {"ffv1", "prores"}) {
    shoot.film("take.mov",
               {.pixel_format = "yuv422p10le",
                .width = 64,
                .height = 48,
                .encoder = encoder,
                .matrix = AVCOL_SPC_RGB,
                .transfer = AVCOL_TRC_RESERVED0,
                .primaries = AVCOL_PRI_RESERVED0},
               {Bytes(64 * 48 * 4, 2)});
    EXPECT_THAT(shoot.import().notes.at(0), HasSubstr("matrix smpte170m (assumed)")) << encoder;
  }
}

TEST(ImportVideo, ReadAsIsCheckedMemberByMember) {
  Shoot shoot;
  const auto error_of = [&](const Json& read_as) {
    shoot.film("take.mkv", {.encoder = "png"}, {noise()}, {{"fps", 25}, {"read_as", read_as}});
    return shoot.error();
  };
  EXPECT_THAT(error_of({{"range", "tv"}}), HasSubstr("allowed: \"full\", \"limited\""));
  EXPECT_THAT(error_of({{"transfer", "slog3"}}), HasSubstr("\"as recorded\", \"srgb\""));
  EXPECT_THAT(error_of({{"pixel_aspect", {1, 0}}}), HasSubstr("pixel_aspect"));
  EXPECT_THAT(error_of({{"pixel_aspect", {1}}}), HasSubstr("two numbers"));
  EXPECT_THAT(error_of({{"gamma", 2.2}}), HasSubstr("gamma"));
  EXPECT_EQ(error_of({{"range", "full"}, {"primaries", "p3-d65"}, {"pixel_aspect", {1, 1}}}), "");
}

}  // namespace previz::exchange::import_video_test
