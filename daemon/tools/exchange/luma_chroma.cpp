#include "daemon/tools/exchange/luma_chroma.hpp"

extern "C" {
#include <libavutil/pixdesc.h>
}

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace previz::exchange {
namespace {

// Older formats say "full range" in their names, which swscale complains about.
AVPixelFormat without_range(AVPixelFormat format) {
  switch (format) {
    case AV_PIX_FMT_YUVJ411P:
      return AV_PIX_FMT_YUV411P;
    case AV_PIX_FMT_YUVJ420P:
      return AV_PIX_FMT_YUV420P;
    case AV_PIX_FMT_YUVJ422P:
      return AV_PIX_FMT_YUV422P;
    case AV_PIX_FMT_YUVJ440P:
      return AV_PIX_FMT_YUV440P;
    case AV_PIX_FMT_YUVJ444P:
      return AV_PIX_FMT_YUV444P;
    default:
      return format;
  }
}

// libav's format of that many bits whose planes are all of the same size.
AVPixelFormat whole_chroma_format(int depth) {
  switch (depth) {
    case 8:
      return AV_PIX_FMT_YUV444P;
    case 9:
      return AV_PIX_FMT_YUV444P9LE;
    case 10:
      return AV_PIX_FMT_YUV444P10LE;
    case 12:
      return AV_PIX_FMT_YUV444P12LE;
    case 14:
      return AV_PIX_FMT_YUV444P14LE;
    case 16:
      return AV_PIX_FMT_YUV444P16LE;
    default:
      return AV_PIX_FMT_NONE;
  }
}

// The codes between which luma goes from 0 to 1 and chroma from -0.5 to 0.5 (H.273, 8.3).
struct Levels {
  float black, luma_range, gray, chroma_range;
};
Levels levels_of(int depth, bool full_range) {
  const auto unit = std::ldexp(1.0f, depth - 8);
  const float most = std::ldexp(1.0f, depth) - 1;
  if (full_range) return {0, most, 128 * unit, most};
  return {16 * unit, 219 * unit, 128 * unit, 224 * unit};
}

std::uint16_t sample_of(float signal) {
  return static_cast<std::uint16_t>(std::lround(65535 * std::clamp(signal, 0.0f, 1.0f)));
}

}  // namespace

std::optional<LumaShares> luma_shares(AVColorSpace matrix) {
  switch (matrix) {
    case AVCOL_SPC_BT709:
      return {{0.2126, 0.0722}};
    case AVCOL_SPC_FCC:
      return {{0.30, 0.11}};
    case AVCOL_SPC_BT470BG:
    case AVCOL_SPC_SMPTE170M:
      return {{0.299, 0.114}};
    case AVCOL_SPC_SMPTE240M:
      return {{0.212, 0.087}};
    case AVCOL_SPC_BT2020_NCL:
      return {{0.2627, 0.0593}};
    default:
      return std::nullopt;
  }
}

LumaChroma::LumaChroma(AVColorSpace matrix, bool full_range)
    : shares_(*luma_shares(matrix)), full_range_(full_range) {}

// swscale interpolates, at the frame's own depth: it rounds what it makes of colours to 8 bits.
const AVFrame& LumaChroma::with_whole_chroma(const AVFrame& frame, const std::string& name) {
  const AVPixelFormat from = without_range(AVPixelFormat(frame.format));
  const AVPixelFormat to = whole_chroma_format(av_pix_fmt_desc_get(from)->comp[0].depth);
  if (from == to) return frame;
  scaler_.reset(sws_getCachedContext(
      scaler_.release(), frame.width, frame.height, from, frame.width, frame.height, to,
      SWS_BILINEAR | SWS_ACCURATE_RND | SWS_BITEXACT, nullptr, nullptr, nullptr));
  if (to == AV_PIX_FMT_NONE || !scaler_)
    throw Error(name + ": " + av_get_pix_fmt_name(from) + " cannot be converted to RGB");
  if (!whole_ || whole_->width != frame.width || whole_->height != frame.height ||
      whole_->format != to) {
    whole_.reset(av::made(av_frame_alloc()));
    whole_->width = frame.width;
    whole_->height = frame.height;
    whole_->format = to;
    av::check(av_frame_get_buffer(whole_.get(), 0), name, "cannot be converted to RGB");
  }
  // The same range on both sides, so that the codes stay what they are.
  const int* any = sws_getCoefficients(SWS_CS_DEFAULT);
  sws_setColorspaceDetails(scaler_.get(), any, 0, any, 0, 0, 1 << 16, 1 << 16);
  sws_scale(scaler_.get(), frame.data, frame.linesize, 0, frame.height, whole_->data,
            whole_->linesize);
  return *whole_;
}

void LumaChroma::convert(const AVFrame& frame, std::span<std::uint16_t> rgb,
                         const std::string& name) {
  const AVFrame& whole = with_whole_chroma(frame, name);
  const AVPixFmtDescriptor& format = *av_pix_fmt_desc_get(AVPixelFormat(whole.format));
  const Levels levels = levels_of(format.comp[0].depth, full_range_);
  const auto kr = static_cast<float>(shares_.red), kb = static_cast<float>(shares_.blue);
  const float kg = 1 - kr - kb;
  const auto width = static_cast<std::size_t>(whole.width);
  std::array<std::vector<std::uint16_t>, 3> row;
  for (auto& component : row) component.resize(width);
  auto out = rgb.begin();
  for (int y = 0; y < whole.height; ++y) {
    for (int c = 0; c < 3; ++c)
      av_read_image_line2(row[static_cast<std::size_t>(c)].data(),
                          const_cast<const std::uint8_t**>(whole.data), whole.linesize, &format, 0,
                          y, c, whole.width, 0, sizeof(std::uint16_t));
    for (std::size_t x = 0; x < width; ++x) {
      const float luma = (row[0][x] - levels.black) / levels.luma_range;
      const float red = luma + 2 * (1 - kr) * (row[2][x] - levels.gray) / levels.chroma_range;
      const float blue = luma + 2 * (1 - kb) * (row[1][x] - levels.gray) / levels.chroma_range;
      *out++ = sample_of(red);
      *out++ = sample_of((luma - kr * red - kb * blue) / kg);
      *out++ = sample_of(blue);
    }
  }
}

}  // namespace previz::exchange
