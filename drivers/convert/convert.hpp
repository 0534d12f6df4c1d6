// From a picture as a device lays it out in memory to a Frame's samples.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/convert/yuv.hpp"
#include "drivers/frame.hpp"

namespace previz::convert {

// What the samples are, in memory order. A Bayer layout is named by its first two rows.
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
  mjpeg,  // a JFIF picture; its own header says the rest
};

// How samples of 9 to 16 bits lie in bytes.
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
  YuvMatrix matrix = YuvMatrix::bt601;  // yuyv, uyvy and nv12 only
  YuvRange range = YuvRange::limited;

  friend bool operator==(const WireFormat&, const WireFormat&) = default;
};

struct WirePicture {
  WireFormat format;
  int width = 0, height = 0;            // pixels
  std::size_t stride = 0;               // bytes from row to row; 0: rows follow without a gap
  std::span<const std::uint8_t> bytes;  // may be more than the picture needs
};

// What a picture becomes: gray8 or gray16, also of Bayer, whose samples stay a mosaic; rgb8 or
// rgb16; yuv422p8 for 4:2:2 that is coded as yuv422p8 is (BT.709, limited range), whose samples so
// stay as they are. Samples of 9 to 15 bits become 16 bits of full range, v -> round(65535 v /
// (2^bits - 1)), which keeps every code apart.
PixelFormat delivered_format(const WireFormat& format);
BayerPattern bayer_pattern(const WireFormat& format);

// The least bytes of a row, and of a whole picture (mjpeg: 0, which says nothing).
std::size_t row_bytes(const WireFormat& format, int width);
std::size_t picture_bytes(const WireFormat& format, int width, int height, std::size_t stride = 0);

// Fills in frame.format, bayer, width, height and bytes. Returns what is wrong with the picture, in
// words ("is cut short: 100 of 3072 bytes"), and leaves the frame alone, if it is not whole.
//
// 4:2:0 and 4:2:2 chroma is sited as MPEG-2 has it and linear in between.
std::optional<std::string> convert(const WirePicture& picture, Frame& frame);

// Parts of the above in files of their own.
std::optional<std::string> decode_jpeg(std::span<const std::uint8_t> jpeg, int width, int height,
                                       std::vector<std::uint8_t>& rgb);
// Interleaved RGB of as many bits. A mosaic is 2x2 pixels at least.
std::vector<std::uint8_t> demosaic(BayerPattern pattern, bool deep, int width, int height,
                                   std::span<const std::uint8_t> mosaic);

}  // namespace previz::convert
