#include "drivers/convert/convert.hpp"

#include "daemon/core/lighting/response.hpp"
#include "drivers/plate.hpp"
#include "tests/support/test.hpp"

namespace previz::convert::convert_test {

using Bytes = std::vector<std::uint8_t>;

WireFormat plain(Layout layout, int bits = 8, Packing packing = Packing::words) {
  return {layout, bits, packing, YuvMatrix::bt601, YuvRange::limited};
}

Frame converted(const WireFormat& format, int width, int height, const Bytes& bytes,
                std::size_t stride = 0) {
  Frame frame;
  const auto damage = convert({format, width, height, stride, bytes}, frame);
  EXPECT_FALSE(damage) << *damage;
  EXPECT_EQ(frame.format, delivered_format(format));
  EXPECT_EQ(frame.bytes.size(), frame_bytes(frame.format, width, height));
  return frame;
}

std::vector<std::uint16_t> words_of(const Bytes& bytes) {
  std::vector<std::uint16_t> words(bytes.size() / 2);
  std::memcpy(words.data(), bytes.data(), 2 * words.size());
  return words;
}

Bytes bytes_of(const std::vector<std::uint16_t>& words) {
  Bytes bytes(2 * words.size());
  std::memcpy(bytes.data(), words.data(), bytes.size());
  return bytes;
}

Bytes random_bytes(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  Bytes bytes(count);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  return bytes;
}

// ---- Y'CbCr

struct Coding {
  YuvMatrix matrix;
  YuvRange range;
};
constexpr Coding codings[] = {{YuvMatrix::bt601, YuvRange::limited},
                              {YuvMatrix::bt601, YuvRange::full},
                              {YuvMatrix::bt709, YuvRange::limited},
                              {YuvMatrix::bt709, YuvRange::full}};

// The Recommendations' equations forward: R'G'B' in 0..1 to codes, not rounded.
std::array<double, 3> encoded(const Coding& coding, double r, double g, double b) {
  const double kr = coding.matrix == YuvMatrix::bt709 ? 0.2126 : 0.299;
  const double kb = coding.matrix == YuvMatrix::bt709 ? 0.0722 : 0.114;
  const double y = kr * r + (1 - kr - kb) * g + kb * b;
  const double cb = (b - y) / (2 * (1 - kb)), cr = (r - y) / (2 * (1 - kr));
  if (coding.range == YuvRange::full) return {255 * y, 128 + 255 * cb, 128 + 255 * cr};
  return {16 + 219 * y, 128 + 224 * cb, 128 + 224 * cr};
}

// Decoding and encoding again comes back to the code, within what rounding R'G'B' to 8 bits moves
// it: half a code a channel moves luma by at most 0.5 (219 or 255)/255 codes, and chroma by at most
// 0.5 * 255/255 * (1 - k)/(2 (1 - k)) * 2 = 0.5 codes. Codes outside R'G'B' are clipped, and left
// out.
TEST(Yuv, DecodesWhatTheRecommendationsEncode) {
  for (const Coding& coding : codings) {
    const YuvToRgb to_rgb(coding.matrix, coding.range);
    int checked = 0;
    for (int y = 0; y < 256; y += 3) {
      for (int cb = 0; cb < 256; cb += 5) {
        for (int cr = 0; cr < 256; cr += 5) {
          std::array<std::uint8_t, 3> rgb{};
          to_rgb(y, 8 * cb, 8 * cr, rgb.data());
          if (*std::ranges::min_element(rgb) == 0 || *std::ranges::max_element(rgb) == 255)
            continue;
          const auto back = encoded(coding, rgb[0] / 255.0, rgb[1] / 255.0, rgb[2] / 255.0);
          EXPECT_NEAR(back[0], y, 0.501);
          EXPECT_NEAR(back[1], cb, 0.501);
          EXPECT_NEAR(back[2], cr, 0.501);
          ++checked;
        }
      }
    }
    EXPECT_GT(checked, 10'000);
  }
}

// 100 % colour bars of BT.601 as 8-bit limited-range codes. A code is off its exact value by at
// most 1/2, so a channel by at most 255 (0.5/219 + 1.772 * 0.5/224) = 1.6, and rounds to within 2.
TEST(Yuv, ColourBarsOfBt601) {
  struct Bar {
    std::uint8_t y, cb, cr;
    std::array<int, 3> rgb;
  };
  for (const Bar& bar : {Bar{235, 128, 128, {255, 255, 255}}, Bar{210, 16, 146, {255, 255, 0}},
                         Bar{170, 166, 16, {0, 255, 255}}, Bar{145, 54, 34, {0, 255, 0}},
                         Bar{106, 202, 222, {255, 0, 255}}, Bar{81, 90, 240, {255, 0, 0}},
                         Bar{41, 240, 110, {0, 0, 255}}, Bar{16, 128, 128, {0, 0, 0}}}) {
    const Frame frame = converted(plain(Layout::yuyv), 2, 1, {bar.y, bar.cb, bar.y, bar.cr});
    for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(frame.bytes[i], bar.rgb[i % 3], 2);
  }
}

constexpr WireFormat yuyv_of_bt709{Layout::yuyv, 8, Packing::words, YuvMatrix::bt709,
                                   YuvRange::limited};

TEST(Yuv, Bt709Limited422KeepsItsSamples) {
  const Frame yuyv =
      converted(yuyv_of_bt709, 4, 2, {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16});
  EXPECT_EQ(yuyv.format, PixelFormat::yuv422p8);
  EXPECT_EQ(yuyv.bytes, (Bytes{1, 3, 5, 7, 9, 11, 13, 15, 2, 6, 10, 14, 4, 8, 12, 16}));
  WireFormat format = yuyv_of_bt709;
  format.layout = Layout::uyvy;
  const Frame uyvy =
      converted(format, 4, 2, {2, 1, 4, 3, 6, 5, 8, 7, 10, 9, 12, 11, 14, 13, 16, 15});
  EXPECT_EQ(uyvy.bytes, yuyv.bytes);
}

TEST(Yuv, OddWidthsHaveHalfAMacroPixel) {
  EXPECT_EQ(row_bytes(yuyv_of_bt709, 3), 8u);
  const Frame frame = converted(yuyv_of_bt709, 3, 1, {1, 2, 3, 4, 5, 6, 99, 8});
  EXPECT_EQ(frame.bytes, (Bytes{1, 3, 5, 2, 6, 4, 8}));
}

// Converted here or later from yuv422p8: the same pixels. The last column of an even width has the
// chroma of the one before it.
TEST(Yuv, BothWaysFrom422AgreeForBt709) {
  for (const int width : {31, 32}) {
    SCOPED_TRACE(width);
    WireFormat format{Layout::uyvy, 8, Packing::words, YuvMatrix::bt709, YuvRange::limited};
    const int height = 9;
    const Bytes bytes = random_bytes(picture_bytes(format, width, height), 1);
    const Plate plate = to_plate(converted(format, width, height, bytes));
    const YuvToRgb to_rgb(YuvMatrix::bt709, YuvRange::limited);
    for (int x = 0; x < width; ++x) {
      const int left = 4 * (x / 2), right = 4 * std::min(x / 2 + x % 2, 15);
      std::array<std::uint8_t, 3> rgb{};
      to_rgb(bytes[2 * x + 1], 4 * (bytes[left] + bytes[right]),
             4 * (bytes[left + 2] + bytes[right + 2]), rgb.data());
      for (int c = 0; c < 3; ++c) EXPECT_EQ(plate.samples[3 * x + c], rgb[c]) << x;
    }
  }
}

// Puts the samples of a picture's planes into the order of a layout.
struct Layout420 {
  const char* name;
  Layout layout;
  Bytes of(const Bytes& luma, const Bytes& cb, const Bytes& cr) const {
    Bytes bytes = luma;
    const auto add = [&](const Bytes& plane) {
      bytes.insert(bytes.end(), plane.begin(), plane.end());
    };
    if (layout == Layout::nv12)
      for (std::size_t i = 0; i < cb.size(); ++i) bytes.insert(bytes.end(), {cb[i], cr[i]});
    if (layout == Layout::i420) add(cb), add(cr);
    if (layout == Layout::yv12) add(cr), add(cb);
    return bytes;
  }
};
constexpr Layout420 layouts_420[] = {
    {"nv12", Layout::nv12}, {"i420", Layout::i420}, {"yv12", Layout::yv12}};

Bytes with_gaps(const Bytes& samples, std::size_t row, std::size_t gap) {
  Bytes bytes;
  for (std::size_t i = 0; i < samples.size(); i += row) {
    bytes.insert(bytes.end(), &samples[i], &samples[i] + row);
    bytes.insert(bytes.end(), gap, 99);
  }
  return bytes;
}

// Luma 126, Cr 128; Cb of the chroma rows 100 and 140. MPEG-2 sites chroma row i at luma row
// 2i + 1/2, so the luma rows see 100 (edge), 110, 130, 140 (edge).
TEST(Yuv, ChromaOf420IsSitedBetweenTheRows) {
  const double cb[] = {100, 110, 130, 140};
  for (const Layout420& made : layouts_420) {
    const Frame frame =
        converted(plain(made.layout), 2, 4, made.of(Bytes(8, 126), {100, 140}, {128, 128}));
    for (int y = 0; y < 4; ++y) {
      const double grey = 255.0 * (126 - 16) / 219.0;
      const double blue = grey + 255.0 * 1.772 * (cb[y] - 128) / 224.0;
      EXPECT_EQ(frame.bytes[6 * y + 0], std::lround(grey)) << made.name;
      EXPECT_EQ(frame.bytes[6 * y + 2], std::lround(blue)) << made.name;
    }
  }
}

TEST(Yuv, ChromaOf420IsLinearAlongTheRows) {
  const double cr[] = {100, 120, 140, 140};
  for (const Layout420& made : layouts_420) {
    const Frame frame =
        converted(plain(made.layout), 4, 1, made.of(Bytes(4, 126), {128, 128}, {100, 140}));
    for (int x = 0; x < 4; ++x)
      EXPECT_EQ(frame.bytes[3 * x],
                std::lround(255.0 * (110.0 / 219.0 + 1.402 * (cr[x] - 128) / 224.0)))
          << made.name;
  }
}

// The same samples in three orders, with and without gaps between the rows: the same pixels.
TEST(Yuv, EveryLayoutOf420HasTheSamePixels) {
  const int width = 31, height = 9;
  const Bytes luma = random_bytes(32 * 9, 1), cb = random_bytes(16 * 5, 2),
              cr = random_bytes(16 * 5, 3);
  const Frame nv12 = converted(plain(Layout::nv12), width, height, layouts_420[0].of(luma, cb, cr));
  for (const Layout420& made : layouts_420) {
    const Bytes tight = made.of(luma, cb, cr);
    EXPECT_EQ(picture_bytes(plain(made.layout), width, height), tight.size()) << made.name;
    EXPECT_EQ(converted(plain(made.layout), width, height, tight).bytes, nv12.bytes) << made.name;
    const bool is_planar = made.layout != Layout::nv12;
    // Gaps of 8 bytes after 32; half of both after the rows of a chroma plane of its own.
    Bytes wide = made.of(with_gaps(luma, 32, 8), with_gaps(cb, 16, 4), with_gaps(cr, 16, 4));
    wide.resize(wide.size() - (is_planar ? 4 : 8));  // the last row has none
    EXPECT_EQ(picture_bytes(plain(made.layout), width, height, 40), wide.size()) << made.name;
    EXPECT_EQ(converted(plain(made.layout), width, height, wide, 40).bytes, nv12.bytes)
        << made.name;
  }
}

Bytes joined_planes(const WireFormat& format, int width, int height, std::size_t stride,
                    std::span<const std::span<const std::uint8_t>> planes) {
  Bytes joined{1, 2, 3};  // of the frame before
  join_planes(format, width, height, stride, planes, joined);
  return joined;
}

// Planes of 2x4 pixels with a stride of 4, each with a byte too many, as page alignment leaves
// them.
TEST(Yuv, PlanesThatLieApartAreJoinedWithoutWhatFollowsTheirLastRows) {
  const Bytes luma{1, 2, 0, 0, 3, 4, 0, 0, 5, 6, 0, 0, 7, 8, 0, 0, 99};
  const Bytes cb{10, 0, 11, 0, 99}, cr{20, 0, 21, 0, 99}, pairs{10, 20, 0, 0, 11, 21, 0, 0, 99};
  const std::array<std::span<const std::uint8_t>, 3> three{luma, cb, cr};
  const std::array<std::span<const std::uint8_t>, 2> two{luma, pairs};
  const Bytes planar = joined_planes(plain(Layout::i420), 2, 4, 4, three);
  EXPECT_EQ(planar, (Bytes{1, 2, 0, 0,  3, 4,  0, 0,  5, 6,  0, 0, 7,
                           8, 0, 0, 10, 0, 11, 0, 20, 0, 21, 0, 99}));
  EXPECT_EQ(
      converted(plain(Layout::i420), 2, 4, planar, 4).bytes,
      converted(plain(Layout::nv12), 2, 4, joined_planes(plain(Layout::nv12), 2, 4, 4, two), 4)
          .bytes);
  // A plane that lacks a byte takes none of the next one's place.
  const std::array<std::span<const std::uint8_t>, 3> short_of_cb{luma, three[1].first(3), cr};
  const Bytes cut = joined_planes(plain(Layout::i420), 2, 4, 4, short_of_cb);
  Frame frame;
  EXPECT_EQ(convert({plain(Layout::i420), 2, 4, 4, cut}, frame), "is truncated: 19 of 23 bytes");
}

// ---- plain samples

TEST(Mono, EveryCodeOfEveryDepthStaysApartAndOnTheLine) {
  for (int bits = 9; bits <= 16; ++bits) {
    const int codes = 1 << bits;
    std::vector<std::uint16_t> all(static_cast<std::size_t>(codes));
    std::iota(all.begin(), all.end(), std::uint16_t{0});
    const Frame frame = converted(plain(Layout::mono, bits), 256, codes / 256, bytes_of(all));
    EXPECT_EQ(frame.format, PixelFormat::gray16);
    const std::vector<std::uint16_t> words = words_of(frame.bytes);
    for (int v = 0; v < codes; ++v)
      ASSERT_EQ(words[static_cast<std::size_t>(v)], std::lround(65535.0 * v / (codes - 1)));
  }
}

TEST(Mono, WhatLiesAboveASamplesBitsIsIgnored) {
  const Frame frame = converted(plain(Layout::mono, 10), 2, 1, bytes_of({0xffff, 0xfc00}));
  EXPECT_EQ(words_of(frame.bytes), (std::vector<std::uint16_t>{65535, 0}));
}

// The samples of a picture are these codes of 0 to `white`.
void expect_codes(const Frame& frame, const std::vector<int>& codes, int white) {
  for (std::size_t i = 0; i < codes.size(); ++i)
    EXPECT_EQ(words_of(frame.bytes)[i], std::lround(65535.0 * codes[i] / white)) << i;
}

// PFNC 2.1, "Mono10p" and "Mono12p": samples follow each other from the lowest bit of each byte.
TEST(Mono, PackedAsOneStreamOfBits) {
  expect_codes(
      converted(plain(Layout::mono, 10, Packing::bits), 4, 1, {0xff, 0x03, 0x50, 0x95, 0xaa}),
      {0x3ff, 0x000, 0x155, 0x2aa}, 0x3ff);
  expect_codes(converted(plain(Layout::mono, 12, Packing::bits), 2, 1, {0xbc, 0x3a, 0x12}),
               {0xabc, 0x123}, 0xfff);
}

// GigE Vision 2.0, "Mono12Packed" and "Mono10Packed".
TEST(Mono, PackedAsGigeVisionDoes) {
  expect_codes(converted(plain(Layout::mono, 12, Packing::gige), 2, 1, {0xab, 0x3c, 0x12}),
               {0xabc, 0x123}, 0xfff);
  expect_codes(converted(plain(Layout::mono, 10, Packing::gige), 2, 1, {0xff, 0x13, 0x80}),
               {0x3ff, 0x201}, 0x3ff);
}

// MIPI CSI-2, "RAW10", "RAW12" and "RAW14": the high bytes of a group, then its low bits, the first
// sample's lowest.
TEST(Mono, PackedAsCsi2Does) {
  // 0x3ff, 0x001, 0x156, 0x2aa: low bits 3, 1, 2, 2
  expect_codes(
      converted(plain(Layout::mono, 10, Packing::csi2), 4, 1, {0xff, 0x00, 0x55, 0xaa, 0xa7}),
      {0x3ff, 0x001, 0x156, 0x2aa}, 0x3ff);
  expect_codes(
      converted(plain(Layout::mono, 12, Packing::csi2), 4, 1, {0xab, 0x12, 0x3c, 0xff, 0x00, 0x1f}),
      {0xabc, 0x123, 0xfff, 0x001}, 0xfff);
  // 0x3fff, 0x0001, 0x2aaa, 0x1555: low bits 3f, 01, 2a, 15
  expect_codes(converted(plain(Layout::mono, 14, Packing::csi2), 4, 1,
                         {0xff, 0x00, 0xaa, 0x55, 0x7f, 0xa0, 0x56}),
               {0x3fff, 0x0001, 0x2aaa, 0x1555}, 0x3fff);
  // 5x2: a row that ends within a group still has the whole group.
  expect_codes(converted(plain(Layout::mono, 10, Packing::csi2), 5, 2,
                         {0, 0, 0, 0, 0, 0xff, 0, 0, 0, 0x03, 0, 0, 0, 0, 0, 0x80, 0, 0, 0, 0x01}),
               {0, 0, 0, 0, 0x3ff, 0, 0, 0, 0, 0x201}, 0x3ff);
  for (const int bits : {9, 11, 13, 15, 16}) {
    const Bytes bytes(100);
    Frame frame;
    EXPECT_TRUE(convert({plain(Layout::mono, bits, Packing::csi2), 4, 1, 0, bytes}, frame)) << bits;
  }
  EXPECT_EQ(row_bytes(plain(Layout::mono, 10, Packing::csi2), 5), 10u);
  EXPECT_EQ(row_bytes(plain(Layout::mono, 12, Packing::csi2), 5), 9u);
}

TEST(Rgb, BothOrdersAtEveryDepth) {
  EXPECT_EQ(converted(plain(Layout::rgb), 2, 1, {1, 2, 3, 4, 5, 6}).bytes,
            (Bytes{1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(converted(plain(Layout::bgr), 2, 1, {1, 2, 3, 4, 5, 6}).bytes,
            (Bytes{3, 2, 1, 6, 5, 4}));
  EXPECT_EQ(words_of(converted(plain(Layout::rgb, 16), 1, 1, bytes_of({1, 0x1234, 65535})).bytes),
            (std::vector<std::uint16_t>{1, 0x1234, 65535}));
  EXPECT_EQ(words_of(converted(plain(Layout::bgr, 12), 1, 1, bytes_of({0, 0x800, 0xfff})).bytes),
            (std::vector<std::uint16_t>{65535, 32776, 0}));
}

TEST(Rows, WhatLiesBetweenThemIsLeftOut) {
  EXPECT_EQ(converted(plain(Layout::mono), 2, 2, {1, 2, 99, 3, 4}, 3).bytes, (Bytes{1, 2, 3, 4}));
  EXPECT_EQ(converted(yuyv_of_bt709, 2, 2, {1, 2, 3, 4, 99, 99, 5, 6, 7, 8}, 6).bytes,
            (Bytes{1, 3, 5, 7, 2, 6, 4, 8}));
}

// ---- Bayer

struct Mosaic {
  Layout layout;
  const char* pattern;  // two rows of two: the channel of each pixel
};
constexpr Mosaic mosaics[] = {{Layout::bayer_rggb, "rggb"},
                              {Layout::bayer_grbg, "grbg"},
                              {Layout::bayer_gbrg, "gbrg"},
                              {Layout::bayer_bggr, "bggr"}};

std::size_t channel_at(const Mosaic& mosaic, int x, int y) {
  return std::string("rgb").find(mosaic.pattern[2 * (y % 2) + x % 2]);
}

// Bytes of a mosaic whose pixel (x, y) has the code colour(x, y)[its channel].
template <typename Colour>
Bytes mosaic_of(const Mosaic& mosaic, int width, int height, bool deep, Colour colour) {
  std::vector<std::uint16_t> words;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      words.push_back(static_cast<std::uint16_t>(colour(x, y)[channel_at(mosaic, x, y)]));
  if (deep) return bytes_of(words);
  return {words.begin(), words.end()};
}

TEST(Bayer, AFlatColourIsThatColourUpToTheEdge) {
  for (const Mosaic& mosaic : mosaics) {
    for (const int bits : {8, 10, 12, 16}) {
      for (const auto& [width, height] : {std::pair{8, 6}, {7, 5}, {4, 4}}) {
        const int white = (1 << bits) - 1;
        const std::array<int, 3> colour{white, white / 3, white / 17};
        const Frame frame =
            converted(plain(mosaic.layout, bits), width, height,
                      mosaic_of(mosaic, width, height, bits > 8, [&](int, int) { return colour; }));
        const Plate plate = to_plate(frame);
        EXPECT_EQ(to_plate(*demosaiced(std::make_shared<Frame>(frame))).samples, plate.samples);
        EXPECT_EQ(plate.bits, bits > 8 ? 16 : 8);
        const int full = (1 << plate.bits) - 1;
        for (std::size_t i = 0; i < plate.samples.size(); ++i)
          ASSERT_EQ(plate.samples[i], std::lround(double(full) * colour[i % 3] / white))
              << mosaic.pattern << " " << bits << " bits, " << width << "x" << height;
      }
    }
  }
}

TEST(Bayer, ASampleStaysAsItIsInItsOwnPlace) {
  for (const Mosaic& mosaic : mosaics) {
    const int width = 17, height = 12;
    const Bytes bytes = random_bytes(2 * width * height, 3);
    const std::vector<std::uint16_t> in = words_of(bytes);
    const Frame frame = converted(plain(mosaic.layout, 16), width, height, bytes);
    EXPECT_EQ(frame.format, PixelFormat::gray16);
    EXPECT_EQ(to_string(frame.bayer), std::string(mosaic.pattern));
    EXPECT_EQ(frame.bytes, bytes);  // what is recorded
    const std::vector<std::uint16_t> out = to_plate(frame).samples;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        ASSERT_EQ(out[3 * (y * width + x) + channel_at(mosaic, x, y)], in[y * width + x]);
  }
}

// On a linear ramp every mean of opposite neighbours is exact; away from the edge, where the mirror
// bends the ramp.
TEST(Bayer, RampsAreReproducedInside) {
  for (const Mosaic& mosaic : mosaics) {
    const int width = 16, height = 14;
    const auto ramp = [](int x, int y) {
      return std::array<int, 3>{1000 + 64 * x + 128 * y, 4000 + 128 * x, 20000 - 64 * y - 32 * x};
    };
    const std::vector<std::uint16_t> out =
        to_plate(converted(plain(mosaic.layout, 16), width, height,
                           mosaic_of(mosaic, width, height, true, ramp)))
            .samples;
    for (int y = 2; y < height - 2; ++y)
      for (int x = 2; x < width - 2; ++x)
        for (int c = 0; c < 3; ++c)
          ASSERT_EQ(out[3 * (y * width + x) + c], ramp(x, y)[c])
              << mosaic.pattern << " " << x << " " << y;
  }
}

// ---- malformed pictures

TEST(Malformed, ShortAndAbsurdPicturesAreRefusedInWords) {
  const std::vector<WireFormat> formats{
      plain(Layout::mono),
      plain(Layout::mono, 10),
      plain(Layout::mono, 12, Packing::bits),
      plain(Layout::mono, 12, Packing::gige),
      plain(Layout::bayer_grbg, 12),
      plain(Layout::rgb),
      plain(Layout::bgr, 16),
      plain(Layout::yuyv),
      plain(Layout::uyvy),
      plain(Layout::nv12),
      plain(Layout::i420),
      plain(Layout::yv12),
  };
  for (const WireFormat& format : formats) {
    const std::size_t whole = picture_bytes(format, 9, 7);
    Frame frame;
    frame.bytes = {42};
    const auto damage_of = [&](int width, int height, std::size_t stride, std::size_t bytes) {
      const Bytes data(bytes);
      return convert({format, width, height, stride, data}, frame).value_or("");
    };
    EXPECT_EQ(damage_of(9, 7, 0, whole - 1), "is truncated: " + std::to_string(whole - 1) + " of " +
                                                 std::to_string(whole) + " bytes");
    EXPECT_NE(damage_of(9, 7, 0, 0), "");
    EXPECT_THAT(damage_of(9, 7, row_bytes(format, 9) - 1, 10'000), HasSubstr("rows of"));
    EXPECT_THAT(damage_of(9, 7, std::size_t{1} << 40, 10'000), HasSubstr("truncated"));
    EXPECT_NE(damage_of(0, 7, 0, 10'000), "");
    EXPECT_NE(damage_of(9, -7, 0, 10'000), "");
    EXPECT_NE(damage_of(1 << 20, 1 << 20, 0, 10'000), "");
    EXPECT_EQ(frame.bytes, (Bytes{42}));
    EXPECT_EQ(damage_of(9, 7, 0, whole), "");
  }
  Frame frame;
  const Bytes bytes(1000);
  EXPECT_TRUE(convert({plain(Layout::mono, 17), 9, 7, 0, bytes}, frame));
  EXPECT_TRUE(convert({plain(Layout::mono, 7), 9, 7, 0, bytes}, frame));
  EXPECT_TRUE(convert({plain(Layout::bayer_rggb), 3, 9, 0, bytes}, frame));
}

// ---- up to the linear picture

TEST(DeepSamples, KeepTheirBitsUpToTheLinearFloatPicture) {
  std::vector<std::uint16_t> all(65536);
  std::iota(all.begin(), all.end(), std::uint16_t{0});
  const Plate plate = to_plate(converted(plain(Layout::mono, 16), 256, 256, bytes_of(all)));
  ASSERT_EQ(plate.bits, 16);
  ResponseCurve linear;
  linear.kind = ResponseCurve::Kind::linear;
  const lighting::Response response(linear, plate.bits);
  float before = -1;
  for (std::size_t i = 0; i < plate.samples.size(); i += 3) {
    const auto signal = static_cast<float>(response.inverse()[plate.samples[i]]);
    EXPECT_GT(signal, before);
    before = signal;
  }
}

}  // namespace previz::convert::convert_test
