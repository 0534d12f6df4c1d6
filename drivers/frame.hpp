// A picture as a device delivered it: native samples, where it came from, when, and how exposed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace previz {

// Sample layouts a driver may deliver. 16-bit samples are little-endian, full range 0..65535.
enum class PixelFormat {
  rgb8,      // interleaved R,G,B, 8 bit
  rgb16,     // interleaved R,G,B, 16 bit
  gray8,     // one plane, 8 bit
  gray16,    // one plane, 16 bit (also raw Bayer)
  yuv422p8,  // planar Y, Cb, Cr; chroma half width; BT.709 limited range
};

// The colour filters over a sensor's samples, by its first two rows. A frame with a pattern is
// gray8 or gray16, as the sensor counted; demosaiced() and to_plate() return its colours.
enum class BayerPattern { none, rggb, grbg, gbrg, bggr };

// Immutable once published; stages share it by FramePtr.
struct Frame {
  std::string source;             // device role: "observer" or "light"
  std::uint64_t sequence = 0;     // the device's own counter; a gap is a dropped frame
  std::int64_t timestamp_ns = 0;  // capture time, session clock
  std::int64_t arrival_ns = 0;    // when the host received it, same clock
  double exposure_s = 0.0;        // shutter time; 0 where unknown
  double gain = 1.0;              // linear sensor gain
  // Absolute exposure: radiance = inverse_response(value) / exposure. Always > 0.
  double exposure = 1.0;
  PixelFormat format = PixelFormat::rgb8;
  BayerPattern bayer = BayerPattern::none;
  int width = 0;   // pixels
  int height = 0;  // pixels
  // Rows packed without padding; planes one after the other.
  std::vector<std::uint8_t> bytes;
};

using FramePtr = std::shared_ptr<const Frame>;

// Returns the bytes of one frame of this format and size, without padding; yuv422p8 of odd width
// has (width + 1) / 2 chroma columns.
std::size_t frame_bytes(PixelFormat format, int width, int height);

// Returns the format's name as written in session.toml: "rgb8", "gray16", ...
const char* to_string(PixelFormat format);
// Inverts to_string; throws std::invalid_argument naming the unknown format.
PixelFormat pixel_format_from_string(const std::string& name);

// These do the same for patterns: "none", "rggb", ...
const char* to_string(BayerPattern pattern);
BayerPattern bayer_pattern_from_string(const std::string& name);

}  // namespace previz
