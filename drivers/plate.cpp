#include "drivers/plate.hpp"

#include <algorithm>
#include <bit>
#include <cstring>

#include "drivers/convert/convert.hpp"
#include "drivers/error.hpp"

namespace previz {
namespace {

// 16-bit samples are copied as the host holds them.
static_assert(std::endian::native == std::endian::little);

std::vector<std::uint16_t> widen(const std::vector<std::uint8_t>& bytes) {
  return {bytes.begin(), bytes.end()};
}

std::vector<std::uint16_t> samples_of_16_bit(const std::vector<std::uint8_t>& bytes) {
  std::vector<std::uint16_t> samples(bytes.size() / 2);
  std::memcpy(samples.data(), bytes.data(), samples.size() * 2);
  return samples;
}

std::vector<std::uint16_t> repeat_three_times(const std::vector<std::uint16_t>& gray) {
  std::vector<std::uint16_t> rgb(gray.size() * 3);
  for (std::size_t i = 0; i < gray.size(); ++i)
    rgb[3 * i] = rgb[3 * i + 1] = rgb[3 * i + 2] = gray[i];
  return rgb;
}

std::vector<std::uint16_t> yuv422_to_rgb(const Frame& frame) {
  const std::size_t width = frame.width, height = frame.height, chroma_width = (width + 1) / 2;
  const std::uint8_t* luma = frame.bytes.data();
  const std::uint8_t* cb = luma + width * height;
  const std::uint8_t* cr = cb + chroma_width * height;
  const convert::YuvToRgb& to_rgb = yuv_of_plates();
  std::vector<std::uint8_t> rgb(3 * width * height);
  for (std::size_t y = 0; y < height; ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t left = y * chroma_width + x / 2;
      const std::size_t right = y * chroma_width + std::min(x / 2 + x % 2, chroma_width - 1);
      to_rgb(luma[y * width + x], 4 * (cb[left] + cb[right]), 4 * (cr[left] + cr[right]),
             &rgb[3 * (y * width + x)]);
    }
  }
  return widen(rgb);
}

std::vector<std::uint8_t> colours_of(const Frame& frame) {
  return convert::demosaic(frame.bayer, frame.format == PixelFormat::gray16, frame.width,
                           frame.height, frame.bytes);
}

}  // namespace

int plate_bits(PixelFormat format) {
  return format == PixelFormat::rgb16 || format == PixelFormat::gray16 ? 16 : 8;
}

void check_size(const Frame& frame) {
  if (frame.bytes.size() != frame_bytes(frame.format, frame.width, frame.height))
    throw Error("frame " + std::to_string(frame.sequence) + " of " + frame.source + " holds " +
                std::to_string(frame.bytes.size()) + " bytes; " + to_string(frame.format) + " of " +
                std::to_string(frame.width) + "x" + std::to_string(frame.height) + " needs " +
                std::to_string(frame_bytes(frame.format, frame.width, frame.height)));
}

const convert::YuvToRgb& yuv_of_plates() {
  static const convert::YuvToRgb to_rgb(convert::YuvMatrix::bt709, convert::YuvRange::limited);
  return to_rgb;
}

FramePtr demosaiced(const FramePtr& frame) {
  if (frame->bayer == BayerPattern::none) return frame;
  check_size(*frame);
  auto colour = std::make_shared<Frame>(*frame);
  colour->format = frame->format == PixelFormat::gray16 ? PixelFormat::rgb16 : PixelFormat::rgb8;
  colour->bayer = BayerPattern::none;
  colour->bytes = colours_of(*frame);
  return colour;
}

Plate to_plate(const Frame& frame) {
  check_size(frame);
  Plate plate{frame.width, frame.height, plate_bits(frame.format), {}};
  switch (frame.format) {
    case PixelFormat::rgb8:
      plate.samples = widen(frame.bytes);
      break;
    case PixelFormat::gray8:
      plate.samples = frame.bayer == BayerPattern::none ? repeat_three_times(widen(frame.bytes))
                                                        : widen(colours_of(frame));
      break;
    case PixelFormat::yuv422p8:
      plate.samples = yuv422_to_rgb(frame);
      break;
    case PixelFormat::rgb16:
      plate.samples = samples_of_16_bit(frame.bytes);
      break;
    case PixelFormat::gray16:
      plate.samples = frame.bayer == BayerPattern::none
                          ? repeat_three_times(samples_of_16_bit(frame.bytes))
                          : samples_of_16_bit(colours_of(frame));
      break;
  }
  return plate;
}

}  // namespace previz
