#include "daemon/core/tracking/photometry.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "drivers/calibration/inverse_response.hpp"
#include "drivers/plate.hpp"

namespace previz::tracking {
namespace {

constexpr double kRed = 0.2126, kGreen = 0.7152, kBlue = 0.0722;  // Rec. 709

std::vector<std::uint8_t> encode(const std::vector<double>& signal) {
  std::vector<std::uint8_t> code(signal.size());
  std::transform(signal.begin(), signal.end(), code.begin(),
                 [](double s) { return std::uint8_t(std::lround(255 * srgb_encode(s))); });
  return code;
}

std::uint16_t sample16(const Frame& frame, std::size_t index) {
  return std::uint16_t(frame.bytes[2 * index] | frame.bytes[2 * index + 1] << 8);
}

std::uint8_t luma8(std::uint8_t r, std::uint8_t g, std::uint8_t b) {
  return std::uint8_t((54 * r + 183 * g + 19 * b + 128) >> 8);
}

}  // namespace

double srgb_encode(double signal) {
  if (!(signal > 0)) return 0;
  if (signal >= 1) return 1;
  return signal <= 0.0031308 ? 12.92 * signal : 1.055 * std::pow(signal, 1 / 2.4) - 0.055;
}

Photometry::Photometry(const ResponseCurve& response)
    : signal8_(256), signal_luma_(256), signal16_(65536) {
  for (int i = 0; i < 256; ++i) {
    signal8_[std::size_t(i)] = inverse_response(response, i / 255.0);
    signal_luma_[std::size_t(i)] = inverse_response(response, (i - 16) / 219.0);
  }
  for (int i = 0; i < 65536; ++i)
    signal16_[std::size_t(i)] = inverse_response(response, i / 65535.0);
  code8_ = encode(signal8_);
  code_luma_ = encode(signal_luma_);
  code16_ = encode(signal16_);
}

std::vector<std::uint8_t> Photometry::gray8(const Frame& frame) const {
  return gray8(frame, {0, 0, frame.width, frame.height});
}

std::vector<std::uint8_t> Photometry::gray8(const Frame& frame, const Region& part) const {
  if (frame.bayer != BayerPattern::none)
    return gray8(*demosaiced(std::make_shared<Frame>(frame)), part);
  const std::size_t columns = std::size_t(part.width);
  std::vector<std::uint8_t> gray(columns * std::size_t(part.height));
  for (int row = 0; row < part.height; ++row)
    gray_row(frame, std::size_t(part.y + row) * std::size_t(frame.width) + std::size_t(part.x),
             columns, gray.data() + std::size_t(row) * columns);
  return gray;
}

void Photometry::gray_row(const Frame& frame, std::size_t first, std::size_t pixels,
                          std::uint8_t* gray) const {
  const std::uint8_t* bytes = frame.bytes.data();
  switch (frame.format) {
    case PixelFormat::rgb8:
      bytes += 3 * first;
      for (std::size_t i = 0; i < pixels; ++i, bytes += 3)
        gray[i] = luma8(code8_[bytes[0]], code8_[bytes[1]], code8_[bytes[2]]);
      break;
    case PixelFormat::rgb16:
      for (std::size_t i = 0; i < pixels; ++i) {
        const std::size_t sample = 3 * (first + i);
        gray[i] = luma8(code16_[sample16(frame, sample)], code16_[sample16(frame, sample + 1)],
                        code16_[sample16(frame, sample + 2)]);
      }
      break;
    case PixelFormat::gray8:
      for (std::size_t i = 0; i < pixels; ++i) gray[i] = code8_[bytes[first + i]];
      break;
    case PixelFormat::gray16:
      for (std::size_t i = 0; i < pixels; ++i) gray[i] = code16_[sample16(frame, first + i)];
      break;
    case PixelFormat::yuv422p8:
      for (std::size_t i = 0; i < pixels; ++i) gray[i] = code_luma_[bytes[first + i]];
      break;
  }
}

double Photometry::luminance(const Frame& frame, int x, int y) const {
  const std::size_t i = std::size_t(y) * std::size_t(frame.width) + std::size_t(x);
  switch (frame.format) {
    case PixelFormat::rgb8: {
      const std::uint8_t* p = &frame.bytes[3 * i];
      return kRed * signal8_[p[0]] + kGreen * signal8_[p[1]] + kBlue * signal8_[p[2]];
    }
    case PixelFormat::rgb16:
      return kRed * signal16_[sample16(frame, 3 * i)] +
             kGreen * signal16_[sample16(frame, 3 * i + 1)] +
             kBlue * signal16_[sample16(frame, 3 * i + 2)];
    case PixelFormat::gray8:
      return signal8_[frame.bytes[i]];
    case PixelFormat::gray16:
      return signal16_[sample16(frame, i)];
    case PixelFormat::yuv422p8:
      return signal_luma_[frame.bytes[i]];
  }
  return 0;
}

}  // namespace previz::tracking
