#include "daemon/core/session/samples.hpp"

#include <cstring>
#include <stdexcept>

namespace previz::session {
namespace {

struct Plane {
  std::size_t row_bytes;
  std::size_t rows;
};

// Returns the planes of those formats whose samples libav holds as a Frame does, apart from padded
// rows.
std::vector<Plane> planes(PixelFormat format, int width, int height) {
  const std::size_t w = width, h = height, half = (w + 1) / 2;
  switch (format) {
    case PixelFormat::rgb8:
      return {{3 * w, h}};
    case PixelFormat::rgb16:
      return {{6 * w, h}};
    case PixelFormat::gray8:
      return {{w, h}};
    case PixelFormat::gray16:
      return {{2 * w, h}};
    case PixelFormat::yuv422p8:
      return {{w, h}, {half, h}, {half, h}};
  }
  throw std::invalid_argument("unknown pixel format");
}

void pack_bgr0(const std::uint8_t* rgb, AVFrame& picture) {
  for (int y = 0; y < picture.height; ++y) {
    std::uint8_t* row = picture.data[0] + static_cast<std::ptrdiff_t>(y) * picture.linesize[0];
    for (int x = 0; x < picture.width; ++x, rgb += 3, row += 4) {
      row[0] = rgb[2];
      row[1] = rgb[1];
      row[2] = rgb[0];
      row[3] = 0;
    }
  }
}

void unpack_bgr0(const AVFrame& picture, std::uint8_t* rgb) {
  for (int y = 0; y < picture.height; ++y) {
    const std::uint8_t* row =
        picture.data[0] + static_cast<std::ptrdiff_t>(y) * picture.linesize[0];
    for (int x = 0; x < picture.width; ++x, rgb += 3, row += 4) {
      rgb[0] = row[2];
      rgb[1] = row[1];
      rgb[2] = row[0];
    }
  }
}

void unpack_gbrp16(const AVFrame& picture, std::uint8_t* rgb) {
  constexpr int plane_of_channel[] = {2, 0, 1};  // planes are G, B, R
  for (int channel = 0; channel < 3; ++channel) {
    const int plane = plane_of_channel[channel];
    std::uint8_t* out = rgb + 2 * channel;
    for (int y = 0; y < picture.height; ++y) {
      const std::uint8_t* row =
          picture.data[plane] + static_cast<std::ptrdiff_t>(y) * picture.linesize[plane];
      for (int x = 0; x < picture.width; ++x, out += 6) std::memcpy(out, row + 2 * x, 2);
    }
  }
}

}  // namespace

AVPixelFormat encoder_format(PixelFormat format) {
  switch (format) {
    case PixelFormat::rgb8:
      return AV_PIX_FMT_BGR0;
    case PixelFormat::rgb16:
      return AV_PIX_FMT_RGB48LE;
    case PixelFormat::gray8:
      return AV_PIX_FMT_GRAY8;
    case PixelFormat::gray16:
      return AV_PIX_FMT_GRAY16LE;
    case PixelFormat::yuv422p8:
      return AV_PIX_FMT_YUV422P;
  }
  throw std::invalid_argument("unknown pixel format");
}

std::optional<PixelFormat> session_format(AVPixelFormat format) {
  switch (format) {
    case AV_PIX_FMT_BGR0:
      return PixelFormat::rgb8;
    case AV_PIX_FMT_RGB48LE:
    case AV_PIX_FMT_GBRP16LE:
      return PixelFormat::rgb16;
    case AV_PIX_FMT_GRAY8:
      return PixelFormat::gray8;
    case AV_PIX_FMT_GRAY16LE:
      return PixelFormat::gray16;
    case AV_PIX_FMT_YUV422P:
      return PixelFormat::yuv422p8;
    default:
      return std::nullopt;
  }
}

void pack(std::span<const std::uint8_t> bytes, PixelFormat format, AVFrame& picture) {
  if (format == PixelFormat::rgb8) return pack_bgr0(bytes.data(), picture);
  const std::uint8_t* in = bytes.data();
  int index = 0;
  for (const Plane& plane : planes(format, picture.width, picture.height)) {
    for (std::size_t row = 0; row < plane.rows; ++row, in += plane.row_bytes)
      std::memcpy(picture.data[index] + row * picture.linesize[index], in, plane.row_bytes);
    ++index;
  }
}

std::vector<std::uint8_t> unpack(const AVFrame& picture) {
  const PixelFormat format = session_format(AVPixelFormat(picture.format)).value();
  std::vector<std::uint8_t> bytes(frame_bytes(format, picture.width, picture.height));
  std::uint8_t* out = bytes.data();
  if (picture.format == AV_PIX_FMT_BGR0) return unpack_bgr0(picture, out), bytes;
  if (picture.format == AV_PIX_FMT_GBRP16LE) return unpack_gbrp16(picture, out), bytes;
  int index = 0;
  for (const Plane& plane : planes(format, picture.width, picture.height)) {
    for (std::size_t row = 0; row < plane.rows; ++row, out += plane.row_bytes)
      std::memcpy(out, picture.data[index] + row * picture.linesize[index], plane.row_bytes);
    ++index;
  }
  return bytes;
}

}  // namespace previz::session
