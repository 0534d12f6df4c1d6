#include "drivers/convert/convert.hpp"

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <utility>

namespace previz::convert {
namespace {

constexpr int max_side_px = 65535;

bool is_bayer(Layout layout) {
  return layout >= Layout::bayer_rggb && layout <= Layout::bayer_bggr;
}

bool is_yuv422(Layout layout) {
  return layout == Layout::yuyv || layout == Layout::uyvy;
}

bool is_yuv420(Layout layout) {
  return layout == Layout::nv12 || layout == Layout::i420 || layout == Layout::yv12;
}

std::size_t channels(Layout layout) {
  return layout == Layout::rgb || layout == Layout::bgr ? 3 : 1;
}

// Returns what is wrong with a picture's numbers, before anything is computed from them.
std::optional<std::string> wrong_shape(const WirePicture& picture) {
  const auto& [format, width, height, stride, bytes] = picture;
  const std::string size = std::to_string(width) + "x" + std::to_string(height);
  if (width < 1 || height < 1 || width > max_side_px || height > max_side_px)
    return "cannot be " + size + " pixels";
  if (format.bits < 8 || format.bits > 16)
    return "cannot have " + std::to_string(format.bits) + " bits per sample";
  if (format.packing == Packing::csi2 && format.bits != 8 && format.bits != 10 &&
      format.bits != 12 && format.bits != 14)
    return "cannot have " + std::to_string(format.bits) + " bits per sample in CSI-2 packing";
  if (is_bayer(format.layout) && (width < 4 || height < 4))
    return "is a Bayer mosaic of " + size + " pixels; the minimum is 4x4";
  if (format.layout == Layout::mjpeg) return std::nullopt;
  const std::size_t row = row_bytes(format, width);
  if (stride != 0 && stride < row)
    return "has rows of " + std::to_string(stride) + " bytes; " + std::to_string(row) +
           " are needed";
  const std::size_t whole = picture_bytes(format, width, height, stride);
  if (bytes.size() < whole)
    return "is truncated: " + std::to_string(bytes.size()) + " of " + std::to_string(whole) +
           " bytes";
  return std::nullopt;
}

// Finds the rows of a picture, whatever lies between them.
class Rows {
 public:
  explicit Rows(const WirePicture& picture)
      : bytes_(picture.bytes.data()),
        stride_(picture.stride ? picture.stride : row_bytes(picture.format, picture.width)) {}
  const std::uint8_t* operator[](std::size_t row) const { return bytes_ + row * stride_; }

 private:
  const std::uint8_t* bytes_;
  std::size_t stride_;
};

// Returns the fewest samples whose low bits fill whole bytes in CSI-2.
std::size_t csi2_group(std::size_t bits) {
  return bits == 12 ? 2 : 4;
}

std::uint32_t csi2_sample(const std::uint8_t* row, std::size_t i, std::size_t bits) {
  const std::size_t group = csi2_group(bits), at = i % group, low_bits = bits - 8;
  const std::uint8_t* high = row + i / group * (group * bits / 8);
  const std::uint8_t* low = high + group;
  const std::size_t first = at * low_bits, last = first + low_bits - 1;
  const std::uint32_t window =
      low[first / 8] | std::uint32_t{last / 8 > first / 8 ? low[last / 8] : std::uint8_t{0}} << 8;
  return std::uint32_t{high[at]} << low_bits | ((window >> (first % 8)) & ((1u << low_bits) - 1));
}

// Returns sample `i` of a row.
std::uint32_t sample(const std::uint8_t* row, std::size_t i, const WireFormat& format) {
  const auto bits = static_cast<std::size_t>(format.bits);
  switch (format.packing) {
    case Packing::words:
      return row[2 * i] | std::uint32_t{row[2 * i + 1]} << 8;
    case Packing::bits: {
      const std::size_t first = i * bits, last = first + bits - 1;
      std::uint32_t window = 0;  // the at most three bytes that the sample touches
      for (std::size_t byte = first / 8; byte <= last / 8; ++byte)
        window |= std::uint32_t{row[byte]} << (8 * (byte - first / 8));
      return window >> (first % 8);
    }
    case Packing::gige: {
      const std::uint8_t* pair = row + 3 * (i / 2);
      const std::size_t low_bits = bits - 8;
      return i % 2 == 0 ? std::uint32_t{pair[0]} << low_bits | (pair[1] & 0x0fu)
                        : std::uint32_t{pair[2]} << low_bits | pair[1] >> 4;
    }
    case Packing::csi2:
      return csi2_sample(row, i, bits);
  }
  throw std::invalid_argument("unknown packing");
}

// Returns samples of 9 to 16 bits as full-range 16-bit words; bits above a sample's own are
// ignored.
std::vector<std::uint8_t> deep_samples(const WirePicture& picture) {
  const WireFormat& format = picture.format;
  const std::uint32_t white = (1u << format.bits) - 1;
  std::vector<std::uint16_t> full_range(white + 1);
  for (std::uint32_t v = 0; v <= white; ++v)
    full_range[v] = static_cast<std::uint16_t>((65535u * std::uint64_t{v} + white / 2) / white);

  const std::size_t a_row = channels(format.layout) * static_cast<std::size_t>(picture.width);
  std::vector<std::uint8_t> out(2 * a_row * static_cast<std::size_t>(picture.height));
  std::uint8_t* at = out.data();
  const Rows rows(picture);
  for (std::size_t y = 0; y < static_cast<std::size_t>(picture.height); ++y) {
    for (std::size_t i = 0; i < a_row; ++i, at += 2) {
      const std::uint16_t value = full_range[sample(rows[y], i, format) & white];
      std::memcpy(at, &value, 2);
    }
  }
  return out;
}

std::vector<std::uint8_t> shallow_samples(const WirePicture& picture) {
  const std::size_t a_row =
      channels(picture.format.layout) * static_cast<std::size_t>(picture.width);
  std::vector<std::uint8_t> out;
  out.reserve(a_row * static_cast<std::size_t>(picture.height));
  const Rows rows(picture);
  for (std::size_t y = 0; y < static_cast<std::size_t>(picture.height); ++y)
    out.insert(out.end(), rows[y], rows[y] + a_row);
  return out;
}

template <typename Sample>
void swap_red_and_blue(std::vector<std::uint8_t>& samples) {
  for (std::size_t i = 0; i + 3 * sizeof(Sample) <= samples.size(); i += 3 * sizeof(Sample))
    std::swap_ranges(&samples[i], &samples[i] + sizeof(Sample), &samples[i] + 2 * sizeof(Sample));
}

std::vector<std::uint8_t> plain_samples(const WirePicture& picture) {
  const bool deep = picture.format.bits > 8;
  std::vector<std::uint8_t> samples = deep ? deep_samples(picture) : shallow_samples(picture);
  if (picture.format.layout == Layout::bgr)
    deep ? swap_red_and_blue<std::uint16_t>(samples) : swap_red_and_blue<std::uint8_t>(samples);
  return samples;
}

// Four bytes of a 4:2:2 row are two pixels; these are the places of their samples.
struct MacroPixel {
  std::size_t y, cb, cr;  // the second luma is at y + 2
};

MacroPixel macro_pixel(Layout layout) {
  return layout == Layout::yuyv ? MacroPixel{0, 1, 3} : MacroPixel{1, 0, 2};
}

std::vector<std::uint8_t> planar_422(const WirePicture& picture) {
  const std::size_t width = picture.width, height = picture.height, half = (width + 1) / 2;
  const MacroPixel at = macro_pixel(picture.format.layout);
  std::vector<std::uint8_t> out(frame_bytes(PixelFormat::yuv422p8, picture.width, picture.height));
  std::uint8_t* luma = out.data();
  std::uint8_t* cb = luma + width * height;
  std::uint8_t* cr = cb + half * height;
  const Rows rows(picture);
  for (std::size_t y = 0; y < height; ++y) {
    for (std::size_t x = 0; x < width; ++x) *luma++ = rows[y][2 * x + at.y];
    for (std::size_t i = 0; i < half; ++i) *cb++ = rows[y][4 * i + at.cb];
    for (std::size_t i = 0; i < half; ++i) *cr++ = rows[y][4 * i + at.cr];
  }
  return out;
}

std::vector<std::uint8_t> rgb_of_422(const WirePicture& picture) {
  const std::size_t width = picture.width, height = picture.height, half = (width + 1) / 2;
  const MacroPixel at = macro_pixel(picture.format.layout);
  const YuvToRgb to_rgb(picture.format.matrix, picture.format.range);
  std::vector<std::uint8_t> rgb(3 * width * height);
  const Rows rows(picture);
  for (std::size_t y = 0; y < height; ++y) {
    const std::uint8_t* row = rows[y];
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t left = 4 * (x / 2), right = 4 * std::min(x / 2 + x % 2, half - 1);
      to_rgb(row[2 * x + at.y], 4 * (row[left + at.cb] + row[right + at.cb]),
             4 * (row[left + at.cr] + row[right + at.cr]), &rgb[3 * (y * width + x)]);
    }
  }
  return rgb;
}

// The chroma planes of a 4:2:0 picture: where the first samples are, and the bytes from each to the
// next one and to the next row.
struct Chroma420 {
  const std::uint8_t *cb, *cr;
  std::size_t step, stride;
};

// The kernel's documentation of V4L2_PIX_FMT_NV12 and V4L2_PIX_FMT_YUV420 ("half as many pad bytes
// after their rows").
Chroma420 chroma_planes(const WirePicture& picture) {
  const std::size_t height = picture.height;
  const std::uint8_t* first = Rows(picture)[height];
  const std::size_t luma_stride =
      picture.stride ? picture.stride : row_bytes(picture.format, picture.width);
  if (picture.format.layout == Layout::nv12) return {first, first + 1, 2, luma_stride};
  const std::size_t stride = luma_stride / 2;
  const std::uint8_t* second = first + (height + 1) / 2 * stride;
  if (picture.format.layout == Layout::yv12) return {second, first, 1, stride};
  return {first, second, 1, stride};
}

// 4:2:0 chroma rows lie midway between luma rows 2i and 2i+1 (MPEG-2), so a luma row takes three
// quarters of the nearer chroma row and one of the other.
std::vector<std::uint8_t> rgb_of_420(const WirePicture& picture) {
  const std::size_t width = picture.width, height = picture.height;
  const std::size_t chroma_width = (width + 1) / 2, chroma_height = (height + 1) / 2;
  const Chroma420 chroma = chroma_planes(picture);
  const YuvToRgb to_rgb(picture.format.matrix, picture.format.range);
  std::vector<std::uint8_t> rgb(3 * width * height);
  const Rows rows(picture);
  for (std::size_t y = 0; y < height; ++y) {
    const std::size_t near = y / 2;
    const std::size_t other =
        y % 2 ? std::min(near + 1, chroma_height - 1) : near - std::min<std::size_t>(near, 1);
    const std::size_t a = near * chroma.stride, b = other * chroma.stride;
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t left = chroma.step * (x / 2);
      const std::size_t right = chroma.step * std::min(x / 2 + x % 2, chroma_width - 1);
      const auto eighths = [&](const std::uint8_t* plane) {
        return 3 * (plane[a + left] + plane[a + right]) + plane[b + left] + plane[b + right];
      };
      to_rgb(rows[y][x], eighths(chroma.cb), eighths(chroma.cr), &rgb[3 * (y * width + x)]);
    }
  }
  return rgb;
}

}  // namespace

PixelFormat delivered_format(const WireFormat& format) {
  const bool deep = format.bits > 8;
  switch (format.layout) {
    case Layout::mono:
    case Layout::bayer_rggb:
    case Layout::bayer_grbg:
    case Layout::bayer_gbrg:
    case Layout::bayer_bggr:
      return deep ? PixelFormat::gray16 : PixelFormat::gray8;
    case Layout::yuyv:
    case Layout::uyvy:
      return format.matrix == YuvMatrix::bt709 && format.range == YuvRange::limited
                 ? PixelFormat::yuv422p8
                 : PixelFormat::rgb8;
    case Layout::nv12:
    case Layout::i420:
    case Layout::yv12:
    case Layout::mjpeg:
      return PixelFormat::rgb8;
    default:
      return deep ? PixelFormat::rgb16 : PixelFormat::rgb8;
  }
}

BayerPattern bayer_pattern(const WireFormat& format) {
  switch (format.layout) {
    case Layout::bayer_rggb:
      return BayerPattern::rggb;
    case Layout::bayer_grbg:
      return BayerPattern::grbg;
    case Layout::bayer_gbrg:
      return BayerPattern::gbrg;
    case Layout::bayer_bggr:
      return BayerPattern::bggr;
    default:
      return BayerPattern::none;
  }
}

std::size_t row_bytes(const WireFormat& format, int width) {
  const std::size_t w = width, bits = format.bits;
  const std::size_t samples = w * channels(format.layout);
  if (format.layout == Layout::mjpeg) return 0;
  if (is_yuv422(format.layout)) return 4 * ((w + 1) / 2);
  if (is_yuv420(format.layout)) return 2 * ((w + 1) / 2);
  if (bits == 8) return samples;
  switch (format.packing) {
    case Packing::words:
      return 2 * samples;
    case Packing::bits:
      return (samples * bits + 7) / 8;
    case Packing::gige:
      return 3 * ((samples + 1) / 2);
    case Packing::csi2: {
      const std::size_t group = csi2_group(bits);
      return (samples + group - 1) / group * (group * bits / 8);
    }
  }
  throw std::invalid_argument("unknown packing");
}

std::size_t picture_bytes(const WireFormat& format, int width, int height, std::size_t stride) {
  const std::size_t row = row_bytes(format, width), rows = height, chroma_rows = (rows + 1) / 2;
  const std::size_t from_row_to_row = stride ? stride : row;
  if (rows == 0) return 0;
  if (format.layout == Layout::nv12) return (rows + chroma_rows - 1) * from_row_to_row + row;
  if (is_yuv420(format.layout))
    return rows * from_row_to_row + (2 * chroma_rows - 1) * (from_row_to_row / 2) + row / 2;
  return (rows - 1) * from_row_to_row + row;
}

void join_planes(const WireFormat& format, int width, int height, std::size_t stride,
                 std::span<const std::span<const std::uint8_t>> planes,
                 std::vector<std::uint8_t>& joined) {
  const std::size_t luma_stride = stride ? stride : row_bytes(format, width), rows = height;
  const std::size_t luma = luma_stride * rows, planar_chroma = luma_stride / 2 * ((rows + 1) / 2);
  joined.clear();
  for (std::size_t i = 0; i < planes.size(); ++i) {
    std::span<const std::uint8_t> plane = planes[i];
    const bool is_last = i + 1 == planes.size();
    const std::size_t needed = i == 0 ? luma : planar_chroma;
    if (!is_last) plane = plane.first(std::min(plane.size(), needed));
    joined.insert(joined.end(), plane.begin(), plane.end());
    if (!is_last && plane.size() < needed) break;
  }
}

std::optional<std::string> convert(const WirePicture& picture, Frame& frame) {
  if (std::optional<std::string> wrong = wrong_shape(picture)) return wrong;
  const PixelFormat delivered = delivered_format(picture.format);
  std::vector<std::uint8_t> bytes;
  switch (picture.format.layout) {
    case Layout::mjpeg:
      if (auto damage = decode_jpeg(picture.bytes, picture.width, picture.height, bytes))
        return damage;
      break;
    case Layout::nv12:
    case Layout::i420:
    case Layout::yv12:
      bytes = rgb_of_420(picture);
      break;
    case Layout::yuyv:
    case Layout::uyvy:
      bytes = delivered == PixelFormat::yuv422p8 ? planar_422(picture) : rgb_of_422(picture);
      break;
    default:
      bytes = plain_samples(picture);
  }
  frame.format = delivered;
  frame.bayer = bayer_pattern(picture.format);
  frame.width = picture.width;
  frame.height = picture.height;
  frame.bytes = std::move(bytes);
  return std::nullopt;
}

}  // namespace previz::convert
