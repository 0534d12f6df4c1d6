// A picture as RGB samples, which a frame is converted to.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "drivers/convert/yuv.hpp"
#include "drivers/frame.hpp"

namespace previz {

// Returns the frame in colour: rgb8 or rgb16 if it has a Bayer pattern, otherwise the frame itself.
// Interpolation is edge-aware (OpenCV) and reaches the picture's edge; a sample keeps its value in
// its own place. Throws previz::Error if `bytes` has not the length of its format and size.
FramePtr demosaiced(const FramePtr& frame);

// The converted RGB plate: interleaved RGB, 8 or 16 bits a sample. "Bit for bit" refers to this.
struct Plate {
  int width = 0;
  int height = 0;
  int bits = 8;                        // 8 or 16 significant bits a sample
  std::vector<std::uint16_t> samples;  // 3*width*height, row-major, 0..2^bits-1
};

using PlatePtr = std::shared_ptr<const Plate>;

// Returns the significant bits of a sample, 8 or 16, in the plate of such a frame.
int plate_bits(PixelFormat format);

// Throws previz::Error if `bytes` has not the length of its format and size.
void check_size(const Frame& frame);

// Converts a frame to its RGB plate. Bayer is demosaiced(), other gray repeats the sample; yuv422p8
// is BT.709 limited range (ITU-R BT.709-6), chroma sited on the even columns and linear between
// them, rounded to nearest, clipped to 0..255. Throws as check_size().
Plate to_plate(const Frame& frame);

// Returns what converts yuv422p8.
const convert::YuvToRgb& yuv_of_plates();

}  // namespace previz
