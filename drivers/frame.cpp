#include "drivers/frame.hpp"

#include <stdexcept>

namespace previz {
namespace {

struct FormatName {
  PixelFormat format;
  const char* name;
};

constexpr FormatName format_names[] = {
    {PixelFormat::rgb8, "rgb8"},         {PixelFormat::rgb16, "rgb16"},
    {PixelFormat::gray8, "gray8"},       {PixelFormat::gray16, "gray16"},
    {PixelFormat::yuv422p8, "yuv422p8"},
};

constexpr std::pair<BayerPattern, const char*> pattern_names[] = {
    {BayerPattern::none, "none"}, {BayerPattern::rggb, "rggb"}, {BayerPattern::grbg, "grbg"},
    {BayerPattern::gbrg, "gbrg"}, {BayerPattern::bggr, "bggr"},
};

}  // namespace

std::size_t frame_bytes(PixelFormat format, int width, int height) {
  if (width < 0 || height < 0)
    throw std::invalid_argument("a frame cannot have a negative width or height");
  const std::size_t w = width, h = height;
  switch (format) {
    case PixelFormat::rgb8:
      return 3 * w * h;
    case PixelFormat::rgb16:
      return 6 * w * h;
    case PixelFormat::gray8:
      return w * h;
    case PixelFormat::gray16:
      return 2 * w * h;
    case PixelFormat::yuv422p8:
      return (w + 2 * ((w + 1) / 2)) * h;
  }
  throw std::invalid_argument("unknown pixel format");
}

const char* to_string(PixelFormat format) {
  for (const FormatName& known : format_names)
    if (known.format == format) return known.name;
  throw std::invalid_argument("unknown pixel format");
}

PixelFormat pixel_format_from_string(const std::string& name) {
  for (const FormatName& known : format_names)
    if (name == known.name) return known.format;
  throw std::invalid_argument("unknown pixel format \"" + name +
                              "\"; allowed: rgb8, rgb16, gray8, gray16, yuv422p8");
}

const char* to_string(BayerPattern pattern) {
  for (const auto& [known, name] : pattern_names)
    if (known == pattern) return name;
  throw std::invalid_argument("unknown Bayer pattern");
}

BayerPattern bayer_pattern_from_string(const std::string& name) {
  for (const auto& [pattern, known] : pattern_names)
    if (name == known) return pattern;
  throw std::invalid_argument("unknown Bayer pattern \"" + name +
                              "\"; allowed: none, rggb, grbg, gbrg, bggr");
}

}  // namespace previz
