// Converts a picture from a device's memory layout to a Frame's samples.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/convert/yuv.hpp"
#include "drivers/frame.hpp"

namespace previz::convert {

// Says what the samples are, in memory order. A Bayer layout is named by its first two rows.
enum class Layout {
  mono,
  bayer_rggb,
  bayer_grbg,
  bayer_gbrg,
  bayer_bggr,
  rgb,    // R, G, B interleaved
  bgr,    // B, G, R interleaved
  yuyv,   // 4:2:2, Y Cb Y Cr
  uyvy,   // 4:2:2, Cb Y Cr Y
  nv12,   // 4:2:0, a plane of Y, then one of Cb Cr pairs
  i420,   // 4:2:0, a plane of Y, one of Cb, one of Cr; the rows of the last two half as far apart
  yv12,   // i420 with Cr before Cb
  mjpeg,  // a JFIF picture; its own header says the rest
};

// Says how samples of 9 to 16 bits lie in bytes.
enum class Packing {
  words,  // little-endian 16-bit words, the sample in the low bits
  bits,   // one stream of bits, lowest first (GenICam PFNC "p": Mono10p, BayerRG12p)
  gige,   // two samples in three bytes (GigE Vision "Packed"): high bits, both low bits, high bits
  csi2,   // groups (MIPI CSI-2 RAW10, RAW12, RAW14): a byte of high bits each, then all low bits
};

struct WireFormat {
  Layout layout = Layout::mono;
  int bits = 8;  // significant bits of a sample, 8 to 16; mono, Bayer, rgb and bgr only
  Packing packing = Packing::words;
  YuvMatrix matrix = YuvMatrix::bt601;  // Y'CbCr only, but for mjpeg
  YuvRange range = YuvRange::limited;

  friend bool operator==(const WireFormat&, const WireFormat&) = default;
};

struct WirePicture {
  WireFormat format;
  int width = 0, height = 0;  // pixels
  std::size_t stride = 0;     // bytes from row to row (of Y); 0: rows follow without a gap
  std::span<const std::uint8_t> bytes;  // may be more than the picture needs
};

// No picture is larger, as it comes or as it is delivered: 16384x16384 pixels of four bytes.
constexpr std::size_t most_picture_bytes = std::size_t{1} << 30;

// Returns the format that a picture is converted to: gray8 or gray16, also for Bayer, whose samples
// stay a mosaic; rgb8 or rgb16; yuv422p8 for 4:2:2 that is coded in the same way (BT.709, limited
// range), whose samples then stay unchanged. Samples of 9 to 15 bits become 16 bits of full range,
// v -> round(65535 v / (2^bits - 1)), which keeps every code apart.
PixelFormat delivered_format(const WireFormat& format);
BayerPattern bayer_pattern(const WireFormat& format);

// Return the least number of bytes of a row (of Y), and of a whole picture (0 for mjpeg, whose size
// is unknown).
std::size_t row_bytes(const WireFormat& format, int width);
std::size_t picture_bytes(const WireFormat& format, int width, int height, std::size_t stride = 0);

// Puts planes that lie apart into one picture, in which each follows the last row of the one
// before, as convert() wants them; replaces what was in `joined`. What a plane has after its last
// row is dropped, but for the last plane's. After a plane that lacks bytes nothing more follows, so
// that the picture is cut short.
void join_planes(const WireFormat& format, int width, int height, std::size_t stride,
                 std::span<const std::span<const std::uint8_t>> planes,
                 std::vector<std::uint8_t>& joined);

// Fills in frame.format, bayer, width, height and bytes. Returns what is wrong with the picture, in
// words ("is cut short: 100 of 3072 bytes"), and leaves the frame alone, if it is not whole.
//
// 4:2:0 and 4:2:2 chroma is sited as in MPEG-2 and interpolated linearly.
std::optional<std::string> convert(const WirePicture& picture, Frame& frame);

// The functions below are parts of convert() that have files of their own.
std::optional<std::string> decode_jpeg(std::span<const std::uint8_t> jpeg, int width, int height,
                                       std::vector<std::uint8_t>& rgb);
// The same row by row, from the top; also of a JPEG in CMYK. Rows of a damaged picture may have
// been taken when it is found to be damaged.
std::optional<std::string> decode_jpeg_rows(
    std::span<const std::uint8_t> jpeg, int width, int height,
    const std::function<void(std::span<const std::uint8_t> rgb)>& take);
// Fills in the size that a JPEG's header says, or returns what is wrong with it.
std::optional<std::string> jpeg_size(std::span<const std::uint8_t> jpeg, int& width, int& height);
// Returns interleaved RGB with as many bits a sample. A mosaic is at least 2x2 pixels.
std::vector<std::uint8_t> demosaic(BayerPattern pattern, bool deep, int width, int height,
                                   std::span<const std::uint8_t> mosaic);

}  // namespace previz::convert
