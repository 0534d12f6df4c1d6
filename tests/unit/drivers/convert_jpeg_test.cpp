// Motion JPEG: decoded right, and refused where it is not whole.

// jpeglib.h needs what <cstdio> declares.
#include <jpeglib.h>

#include "drivers/convert/convert.hpp"
#include "tests/support/test.hpp"

namespace previz::convert::convert_jpeg_test {

using Bytes = std::vector<std::uint8_t>;

constexpr WireFormat mjpeg{Layout::mjpeg, 8, Packing::words, YuvMatrix::bt601, YuvRange::full};

// As webcams send them: 4:2:2, the standard Huffman tables left out where `abbreviated`.
// Where `scans` is not empty, the picture is a progressive one of these scans.
Bytes jpeg_of(int width, int height, const Bytes& rgb, bool abbreviated = false,
              const std::vector<jpeg_scan_info>& scans = {}, J_COLOR_SPACE space = JCS_RGB) {
  jpeg_compress_struct encoder{};
  jpeg_error_mgr errors{};
  encoder.err = jpeg_std_error(&errors);
  jpeg_create_compress(&encoder);
  unsigned char* data = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&encoder, &data, &size);
  encoder.image_width = static_cast<JDIMENSION>(width);
  encoder.image_height = static_cast<JDIMENSION>(height);
  encoder.input_components = space == JCS_CMYK ? 4 : 3;
  encoder.in_color_space = space;
  jpeg_set_defaults(&encoder);
  jpeg_set_quality(&encoder, 100, TRUE);
  encoder.comp_info[0].h_samp_factor = space == JCS_CMYK ? 1 : 2;
  encoder.comp_info[0].v_samp_factor = 1;
  if (abbreviated)
    for (int i = 0; i < 2; ++i)
      encoder.dc_huff_tbl_ptrs[i]->sent_table = encoder.ac_huff_tbl_ptrs[i]->sent_table = TRUE;
  if (!scans.empty()) {
    encoder.scan_info = scans.data();
    encoder.num_scans = static_cast<int>(scans.size());
  }
  jpeg_start_compress(&encoder, abbreviated ? FALSE : TRUE);
  for (int y = 0; y < height; ++y) {
    auto* row =
        const_cast<JSAMPLE*>(&rgb[static_cast<std::size_t>(encoder.input_components * y * width)]);
    jpeg_write_scanlines(&encoder, &row, 1);
  }
  jpeg_finish_compress(&encoder);
  jpeg_destroy_compress(&encoder);
  Bytes jpeg(data, data + size);
  std::free(data);
  return jpeg;
}

// 8x8 pixels of these inks, with the mark of Adobe's programs, which store what is missing of each.
Bytes jpeg_of_inks(const std::array<std::uint8_t, 4>& missing) {
  Bytes samples;
  for (int i = 0; i < 64; ++i) samples.insert(samples.end(), missing.begin(), missing.end());
  return jpeg_of(8, 8, samples, false, {}, JCS_CMYK);
}

Bytes flat(int width, int height, const std::array<std::uint8_t, 3>& colour) {
  Bytes rgb;
  for (int i = 0; i < width * height; ++i) rgb.insert(rgb.end(), colour.begin(), colour.end());
  return rgb;
}

Bytes noise(int width, int height) {
  std::mt19937 random(5);
  Bytes rgb(std::size_t{3} * static_cast<std::size_t>(width * height));
  for (std::uint8_t& byte : rgb) byte = static_cast<std::uint8_t>(random());
  return rgb;
}

// A flat picture has only DC terms, in steps of an eighth of 8 codes at quality 100: each of Y, Cb
// and Cr is off by at most 1/2 (its rounding) + 1/2 (its step), so R by at most 1 + 1.402, B by
// 1 + 1.772, G by 1 + 0.344 + 0.714, each rounded: 3.
TEST(Mjpeg, FlatColoursComeBack) {
  for (const bool abbreviated : {false, true}) {
    for (const std::array<std::uint8_t, 3>& colour :
         {std::array<std::uint8_t, 3>{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {200, 120, 40}}) {
      const Bytes jpeg = jpeg_of(35, 18, flat(35, 18, colour), abbreviated);
      Frame frame;
      const auto damage = convert({mjpeg, 35, 18, 0, jpeg}, frame);
      ASSERT_FALSE(damage) << *damage;
      ASSERT_EQ(frame.bytes.size(), frame_bytes(PixelFormat::rgb8, 35, 18));
      for (std::size_t i = 0; i < frame.bytes.size(); ++i)
        ASSERT_NEAR(frame.bytes[i], colour[i % 3], 3);
    }
  }
}

TEST(Mjpeg, EveryCutIsNoticed) {
  const Bytes jpeg = jpeg_of(48, 32, noise(48, 32));
  for (std::size_t size = 0; size + 2 < jpeg.size(); size += size < 700 ? 1 : 13) {
    // In memory of its own, so that reading past the end is seen.
    const Bytes cut(jpeg.begin(), jpeg.begin() + static_cast<std::ptrdiff_t>(size));
    Frame frame;
    EXPECT_TRUE(convert({mjpeg, 48, 32, 0, cut}, frame)) << size << " of " << jpeg.size();
    EXPECT_TRUE(frame.bytes.empty());
  }
  Frame frame;
  EXPECT_TRUE(convert({mjpeg, 48, 32, 0, Bytes(jpeg.begin(), jpeg.end() - 3)}, frame));
  EXPECT_FALSE(convert({mjpeg, 48, 32, 0, jpeg}, frame));
}

// Some cameras leave out the last marker (EOI), or half of it; the picture is all there.
TEST(Mjpeg, APictureWithoutItsLastMarkerIsWhole) {
  for (const auto& [width, height] : {std::pair{48, 32}, std::pair{35, 18}}) {
    const Bytes jpeg = jpeg_of(width, height, noise(width, height));
    Frame whole, cut;
    ASSERT_FALSE(convert({mjpeg, width, height, 0, jpeg}, whole));
    for (const int missing : {1, 2}) {
      const Bytes bytes(jpeg.begin(), jpeg.end() - missing);
      ASSERT_FALSE(convert({mjpeg, width, height, 0, bytes}, cut)) << missing;
      EXPECT_EQ(cut.bytes, whole.bytes);
    }
  }
}

// Buffers are often longer than the picture in them, and some cameras pad before the last marker.
TEST(Mjpeg, PaddingIsNoDamage) {
  Bytes padded = jpeg_of(48, 32, noise(48, 32));
  padded.insert(padded.end(), 100, 0);
  Frame frame;
  EXPECT_FALSE(convert({mjpeg, 48, 32, 0, padded}, frame));
  Bytes inside = jpeg_of(48, 32, noise(48, 32));
  inside.insert(inside.end() - 2, 7, 0);
  EXPECT_FALSE(convert({mjpeg, 48, 32, 0, inside}, frame));
}

TEST(Mjpeg, APictureOfAnotherSizeIsRefused) {
  const Bytes jpeg = jpeg_of(48, 32, noise(48, 32));
  Frame frame;
  EXPECT_EQ(convert({mjpeg, 32, 48, 0, jpeg}, frame).value_or(""),
            "is a JPEG of 48x32 pixels; 32x48 was agreed");
}

// A scan of the mean of every block, then `bands` scans of the other coefficients of the
// brightness, and one of each colour.
std::vector<jpeg_scan_info> progressive(int bands) {
  std::vector<jpeg_scan_info> scans{{3, {0, 1, 2, 0}, 0, 0, 0, 0}};
  for (int i = 0; i < bands; ++i)
    scans.push_back({1, {0, 0, 0, 0}, i + 1, i + 1 < bands ? i + 1 : 63, 0, 0});
  for (const int colour : {1, 2}) scans.push_back({1, {colour, 0, 0, 0}, 1, 63, 0, 0});
  return scans;
}

TEST(Mjpeg, ProgressivePicturesOfTooManyScansAreRefused) {
  const Bytes rgb = noise(48, 32);
  Frame plain, in_scans;
  ASSERT_FALSE(convert({mjpeg, 48, 32, 0, jpeg_of(48, 32, rgb)}, plain));
  ASSERT_FALSE(convert({mjpeg, 48, 32, 0, jpeg_of(48, 32, rgb, false, progressive(17))}, in_scans));
  EXPECT_EQ(in_scans.bytes, plain.bytes);  // of 20 scans
  Frame none;
  for (const int bands : {18, 19}) {
    const Bytes jpeg = jpeg_of(48, 32, rgb, false, progressive(bands));
    EXPECT_EQ(convert({mjpeg, 48, 32, 0, jpeg}, none).value_or(""),
              "is a damaged JPEG: it has too many scans");
  }
  EXPECT_TRUE(none.bytes.empty());
}

// Whatever a device or a header claims, memory is asked for only once the data can be of that size.
TEST(Mjpeg, ClaimsOfLargerPicturesTakeNoMemory) {
  Bytes jpeg = jpeg_of(48, 32, noise(48, 32)), rgb;
  EXPECT_EQ(decode_jpeg(jpeg, 2000, 2000, rgb).value_or(""),
            "is a JPEG of 48x32 pixels; 2000x2000 was agreed");
  EXPECT_EQ(rgb.capacity(), 0u);
  constexpr std::array<std::uint8_t, 2> start_of_frame{0xff, 0xc0};
  const auto found =
      std::search(jpeg.begin(), jpeg.end(), start_of_frame.begin(), start_of_frame.end());
  ASSERT_NE(found, jpeg.end());
  // Height and width, after length and precision: 2000 each.
  constexpr std::array<std::uint8_t, 4> sides{0x07, 0xd0, 0x07, 0xd0};
  std::ranges::copy(sides, found + 5);
  EXPECT_EQ(decode_jpeg(jpeg, 2000, 2000, rgb).value_or(""),
            "is a JPEG of " + std::to_string(jpeg.size()) + " bytes, too few for 2000x2000 pixels");
  EXPECT_EQ(rgb.capacity(), 0u);
}

TEST(Mjpeg, DamageDoesNoHarm) {
  const Bytes jpeg = jpeg_of(48, 32, noise(48, 32));
  std::mt19937 random(9);
  for (int i = 0; i < 400; ++i) {
    Bytes damaged = jpeg;
    for (int flips = 0; flips <= i % 8; ++flips)
      damaged[random() % damaged.size()] = static_cast<std::uint8_t>(random());
    Frame frame;
    if (!convert({mjpeg, 48, 32, 0, damaged}, frame)) {
      EXPECT_EQ(frame.bytes.size(), frame_bytes(PixelFormat::rgb8, 48, 32));
    }
  }
}

// Textures may be in CMYK; a camera's pictures are not.
TEST(ConvertJpegRows, TurnsInksIntoLight) {
  const Bytes jpeg = jpeg_of_inks({200, 100, 50, 204});
  int width = 0, height = 0, rows = 0;
  EXPECT_EQ(jpeg_size(jpeg, width, height), std::nullopt);
  EXPECT_EQ(width, 8);
  EXPECT_EQ(height, 8);
  const auto look = [&](std::span<const std::uint8_t> rgb) {
    ++rows;
    ASSERT_EQ(rgb.size(), 24u);
    for (std::size_t x = 0; x < 8; ++x)
      for (const auto& [c, light] : {std::pair(0, 160), {1, 80}, {2, 40}})  // of 0.8 without black
        EXPECT_NEAR(rgb[3 * x + static_cast<std::size_t>(c)], light, 1);
  };
  EXPECT_EQ(decode_jpeg_rows(jpeg, 8, 8, look), std::nullopt);
  EXPECT_EQ(rows, 8);
  Bytes frame;
  EXPECT_THAT(decode_jpeg(jpeg, 8, 8, frame), Optional(HasSubstr("CMYK")));
}

}  // namespace previz::convert::convert_jpeg_test
