#include "drivers/plate.hpp"
#include "tests/support/test.hpp"

namespace previz::frame_conversion_test {

Frame frame_of(PixelFormat format, int width, int height, std::vector<std::uint8_t> bytes) {
  Frame frame;
  frame.format = format;
  frame.width = width;
  frame.height = height;
  frame.bytes = std::move(bytes);
  return frame;
}

using Rgb = std::array<int, 3>;

Rgb rgb_of_yuv(std::uint8_t y, std::uint8_t cb, std::uint8_t cr) {
  const Plate plate = to_plate(frame_of(PixelFormat::yuv422p8, 2, 1, {y, y, cb, cr}));
  return {plate.samples[0], plate.samples[1], plate.samples[2]};
}

TEST(Frame, BytesOfEveryFormat) {
  EXPECT_EQ(frame_bytes(PixelFormat::rgb8, 4, 3), 36u);
  EXPECT_EQ(frame_bytes(PixelFormat::rgb16, 4, 3), 72u);
  EXPECT_EQ(frame_bytes(PixelFormat::gray8, 4, 3), 12u);
  EXPECT_EQ(frame_bytes(PixelFormat::gray16, 4, 3), 24u);
  EXPECT_EQ(frame_bytes(PixelFormat::yuv422p8, 4, 3), 24u);
  EXPECT_EQ(frame_bytes(PixelFormat::yuv422p8, 5, 3), 33u);  // 5 + 3 + 3 a row
  EXPECT_EQ(frame_bytes(PixelFormat::rgb8, 0, 0), 0u);
  EXPECT_THROW(frame_bytes(PixelFormat::rgb8, -1, 3), std::invalid_argument);
}

TEST(Frame, FormatNamesComeBack) {
  for (const PixelFormat format : {PixelFormat::rgb8, PixelFormat::rgb16, PixelFormat::gray8,
                                   PixelFormat::gray16, PixelFormat::yuv422p8})
    EXPECT_EQ(pixel_format_from_string(to_string(format)), format);
  EXPECT_THROW(pixel_format_from_string("nv12"), std::invalid_argument);
}

TEST(Frame, RgbIsCopied) {
  const Plate plate = to_plate(frame_of(PixelFormat::rgb8, 2, 1, {0, 1, 2, 253, 254, 255}));
  EXPECT_EQ(plate.bits, 8);
  EXPECT_EQ(plate.samples, (std::vector<std::uint16_t>{0, 1, 2, 253, 254, 255}));
}

TEST(Frame, SixteenBitsKeepTheirBits) {
  const std::vector<std::uint8_t> bytes{0x01, 0x00, 0x34, 0x12, 0xff, 0xff};
  const Plate rgb = to_plate(frame_of(PixelFormat::rgb16, 1, 1, bytes));
  EXPECT_EQ(rgb.bits, 16);
  EXPECT_EQ(rgb.samples, (std::vector<std::uint16_t>{0x0001, 0x1234, 0xffff}));
  const Plate gray = to_plate(frame_of(PixelFormat::gray16, 1, 3, bytes));
  EXPECT_EQ(gray.bits, 16);
  EXPECT_EQ(gray.samples,
            (std::vector<std::uint16_t>{1, 1, 1, 0x1234, 0x1234, 0x1234, 0xffff, 0xffff, 0xffff}));
}

TEST(Frame, GrayIsRepeated) {
  const Plate plate = to_plate(frame_of(PixelFormat::gray8, 2, 1, {7, 255}));
  EXPECT_EQ(plate.bits, 8);
  EXPECT_EQ(plate.samples, (std::vector<std::uint16_t>{7, 7, 7, 255, 255, 255}));
}

// Exact values of the rational formula, worked by hand: e.g. y = 126, cb = 90, cr = 200:
// E'y = 110/219, R = E'y + 1.5748*72/224 = 1.00847 -> clipped 255; B = E'y + 1.8556*(-38)/224 =
// 0.18749 -> 47.81 -> 48; G = (E'y - 0.2126*1.00847 - 0.0722*0.18749)/0.7152 = 0.38359 -> 97.82.
TEST(Frame, Bt709ReferenceValues) {
  EXPECT_EQ(rgb_of_yuv(126, 90, 200), (Rgb{255, 98, 48}));
  EXPECT_EQ(rgb_of_yuv(126, 128, 128), (Rgb{128, 128, 128}));  // 110/219*255 = 128.08
  EXPECT_EQ(rgb_of_yuv(0, 128, 128), (Rgb{0, 0, 0}));          // below black
  EXPECT_EQ(rgb_of_yuv(255, 128, 128), (Rgb{255, 255, 255}));  // above white
}

TEST(Frame, OddWidthsOfYuv) {
  const Plate plate =
      to_plate(frame_of(PixelFormat::yuv422p8, 1, 2, {235, 16, 128, 128, 128, 128}));
  EXPECT_EQ(plate.samples, (std::vector<std::uint16_t>{255, 255, 255, 0, 0, 0}));
}

TEST(Frame, WrongLengthIsRefused) {
  EXPECT_THROW(to_plate(frame_of(PixelFormat::rgb8, 2, 2, {1, 2, 3})), Error);
}

}  // namespace previz::frame_conversion_test
