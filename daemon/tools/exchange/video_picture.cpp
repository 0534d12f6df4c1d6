#include "daemon/tools/exchange/video_picture.hpp"

extern "C" {
#include <libavutil/imgutils.h>
#include <libavutil/pixdesc.h>
}

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "daemon/core/session/av.hpp"
#include "drivers/error.hpp"

namespace previz::exchange {
namespace {

const AVPixFmtDescriptor& description_of(const AVFrame& frame) {
  const AVPixFmtDescriptor* description = av_pix_fmt_desc_get(AVPixelFormat(frame.format));
  if (!description) throw Error("libav names a format that it does not describe");
  return *description;
}

int depth_of(const AVFrame& frame) {
  return description_of(frame).comp[0].depth;
}

// The 16 bits of a sample in `depth` bits, which is black to white from 16 to 235 if `limited`,
// both by 2^(depth - 8).
std::vector<std::uint16_t> gray_levels(int depth, bool limited) {
  const double unit = std::ldexp(1.0, depth - 8);
  const double black = limited ? 16 * unit : 0;
  const double white = limited ? 235 * unit : std::ldexp(1.0, depth) - 1;
  std::vector<std::uint16_t> levels;
  for (int i = 0; i < 1 << depth; ++i)
    levels.push_back(static_cast<std::uint16_t>(
        std::lround(65535 * std::clamp((i - black) / (white - black), 0.0, 1.0))));
  return levels;
}

std::uint8_t byte_of(std::uint16_t sample) {
  return static_cast<std::uint8_t>((sample + 128) / 257);
}

// Returns the samples of a picture that has 16 bits for each.
std::span<std::uint16_t> deep_samples(Picture& picture) {
  return {reinterpret_cast<std::uint16_t*>(picture.bytes.data()),
          picture.bytes.size() / sizeof(std::uint16_t)};
}

}  // namespace

VideoPictures::VideoPictures(const AVFrame& first, AVStream& stream, AVFormatContext& context,
                             const NamedColors& container, const ReadAs& read_as,
                             std::filesystem::path file)
    : file_(std::move(file)),
      tags_(tags_of(first, stream, context, container, read_as, file_)),
      // Grey has no colours to convert, and swscale gives Y'CbCr its full range.
      colors_(tags_.transfer,
              is_gray(AVPixelFormat(first.format)) ? AVCOL_PRI_UNSPECIFIED : tags_.primaries,
              is_rgb(AVPixelFormat(first.format)) && !tags_.full_range) {
  const Target target = target_of(first);
  std::string done = stays_as_it_is(first)
                         ? "kept as it is"
                         : fmt::format("converted to {}", to_string(target.format));
  if (colors_.changes_anything()) done += ", sRGB's curve, Rec. 709";
  notes_.push_back(fmt::format("{}: {}: {}", file_.string(), tags_.words, done));
  const auto keeps = [&](const char* member) {
    return fmt::format("; \"read_as\": {{{}}} beside \"video\" keeps the file's {}x{}", member,
                       first.width, first.height);
  };
  if (!tags_.orientation.is_upright())
    shape_.push_back("its pictures are " + tags_.orientation.words() +
                     keeps("\"rotation_deg\": 0"));
  if (tags_.pixel_aspect.num != tags_.pixel_aspect.den)
    shape_.push_back(fmt::format("its pixels, {}:{} wide to high, are resampled to square{}",
                                 tags_.pixel_aspect.num, tags_.pixel_aspect.den,
                                 keeps("\"pixel_aspect\": [1, 1]")));
  if (!tags_.orientation.is_upright())
    notes_.push_back(fmt::format("{}: its pictures are {}, so that they are upright",
                                 file_.string(), tags_.orientation.words()));
  if (tags_.pixel_aspect.num != tags_.pixel_aspect.den)
    notes_.push_back(fmt::format("{}: its pixels, {}:{} wide to high, are resampled to square",
                                 file_.string(), tags_.pixel_aspect.num, tags_.pixel_aspect.den));
  if (tags_.transfer == AVCOL_TRC_SMPTE2084 || tags_.transfer == AVCOL_TRC_ARIB_STD_B67)
    notes_.push_back(fmt::format(
        "{}: is high dynamic range: {} is the picture's white, so that nothing below it is lost "
        "and "
        "a white wall is at about a quarter of the light",
        file_.string(),
        tags_.transfer == AVCOL_TRC_SMPTE2084 ? "1000 cd/m2" : "the most that HLG can say"));
  if (description_of(first).flags & AV_PIX_FMT_FLAG_ALPHA)
    notes_.push_back(file_.string() + ": its transparency is not used");
  if (av::is_interlaced(first))
    notes_.push_back(file_.string() + ": is interlaced; its fields are kept as they are");
}

std::vector<std::string> VideoPictures::notes() const {
  std::vector<std::string> notes = notes_;
  if (const double share = colors_.clipped_share(); share > 0)
    notes.push_back(file_.string() + ": " + clipping_words(share));
  return notes;
}

bool VideoPictures::stays_as_it_is(const AVFrame& frame) const {
  const auto format = AVPixelFormat(frame.format);
  return target_of(frame).av_format == format && !colors_.changes_anything() &&
         (tags_.full_range || !is_gray(format));
}

VideoPictures::Target VideoPictures::target_of(const AVFrame& frame) const {
  const auto format = AVPixelFormat(frame.format);
  const bool deep = depth_of(frame) > 8 || colors_.changes_anything();
  if (is_gray(format))
    return deep ? Target{PixelFormat::gray16, AV_PIX_FMT_GRAY16LE}
                : Target{PixelFormat::gray8, AV_PIX_FMT_GRAY8};
  const bool is_shaped =
      !tags_.orientation.is_upright() || tags_.pixel_aspect.num != tags_.pixel_aspect.den;
  if (format == AV_PIX_FMT_YUV422P && tags_.matrix == AVCOL_SPC_BT709 && !tags_.full_range &&
      !colors_.changes_anything() && !is_shaped)
    return {PixelFormat::yuv422p8, format};
  return deep ? Target{PixelFormat::rgb16, AV_PIX_FMT_RGB48LE}
              : Target{PixelFormat::rgb8, AV_PIX_FMT_RGB24};
}

Picture VideoPictures::picture(const AVFrame& frame, const std::string& name) {
  const Target target = target_of(frame);
  Picture picture{target.format, frame.width, frame.height, {}, name, {}, 0};
  picture.bytes.resize(frame_bytes(target.format, picture.width, picture.height));
  if (is_gray(AVPixelFormat(frame.format)))
    convert_gray(frame, picture);
  else if (target.av_format == AVPixelFormat(frame.format))
    copy(frame, picture);
  else
    convert_color(frame, target.av_format, picture);
  if (colors_.changes_anything() && !is_gray(AVPixelFormat(frame.format)))
    colors_.convert(deep_samples(picture));
  make_square(picture, tags_.pixel_aspect.num, tags_.pixel_aspect.den);
  turn(picture, tags_.orientation);
  return picture;
}

void VideoPictures::copy(const AVFrame& frame, Picture& picture) const {
  av::check(av_image_copy_to_buffer(picture.bytes.data(), static_cast<int>(picture.bytes.size()),
                                    frame.data, frame.linesize, AVPixelFormat(frame.format),
                                    picture.width, picture.height, 1),
            file_, "cannot be copied");
}

void VideoPictures::convert_gray(const AVFrame& frame, Picture& picture) const {
  if (stays_as_it_is(frame)) return copy(frame, picture);
  const AVPixFmtDescriptor& description = description_of(frame);
  const std::vector<std::uint16_t> levels = gray_levels(depth_of(frame), !tags_.full_range);
  std::vector<std::uint16_t> row(static_cast<std::size_t>(frame.width));
  auto* deep = reinterpret_cast<std::uint16_t*>(picture.bytes.data());
  std::uint8_t* shallow = picture.bytes.data();
  for (int y = 0; y < frame.height; ++y) {
    av_read_image_line2(row.data(), const_cast<const std::uint8_t**>(frame.data), frame.linesize,
                        &description, 0, y, 0, frame.width, 0, sizeof(std::uint16_t));
    for (std::uint16_t& sample : row) sample = colors_.gray(levels[sample]);
    if (picture.format == PixelFormat::gray16)
      deep = std::ranges::copy(row, deep).out;
    else
      for (const std::uint16_t sample : row) *shallow++ = byte_of(sample);
  }
}

// Y'CbCr, or RGB that lies in memory in another way.
void VideoPictures::convert_color(const AVFrame& frame, AVPixelFormat format, Picture& picture) {
  if (is_rgb(AVPixelFormat(frame.format))) return repack(frame, format, picture);
  if (!luma_chroma_) luma_chroma_.emplace(tags_.matrix, tags_.full_range);
  if (picture.format == PixelFormat::rgb16)
    return luma_chroma_->convert(frame, deep_samples(picture), picture.name);
  std::vector<std::uint16_t> deep(picture.bytes.size());
  luma_chroma_->convert(frame, deep, picture.name);
  std::ranges::transform(deep, picture.bytes.begin(), byte_of);
}

void VideoPictures::repack(const AVFrame& frame, AVPixelFormat format, Picture& picture) {
  // swscale makes less than white of 8 bits' white where it goes to 16 (65283).
  const bool widens = format == AV_PIX_FMT_RGB48LE && depth_of(frame) <= 8;
  if (widens) format = AV_PIX_FMT_RGB24;
  scaler_.reset(sws_getCachedContext(scaler_.release(), picture.width, picture.height,
                                     AVPixelFormat(frame.format), picture.width, picture.height,
                                     format, SWS_BILINEAR | SWS_ACCURATE_RND | SWS_BITEXACT,
                                     nullptr, nullptr, nullptr));
  if (!scaler_) throw Error(picture.name + ": " + tags_.words + ": cannot be converted to RGB");
  std::array<std::uint8_t*, 4> planes{};
  std::array<int, 4> strides{};
  av_image_fill_arrays(planes.data(), strides.data(), picture.bytes.data(), format, picture.width,
                       picture.height, 1);
  sws_scale(scaler_.get(), frame.data, frame.linesize, 0, picture.height, planes.data(),
            strides.data());
  if (!widens) return;
  // In the same bytes, from the last sample on.
  const std::span<std::uint16_t> deep = deep_samples(picture);
  for (std::size_t i = deep.size(); i-- > 0;)
    deep[i] = static_cast<std::uint16_t>(257 * picture.bytes[i]);
}

}  // namespace previz::exchange
