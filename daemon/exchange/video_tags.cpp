#include "daemon/exchange/video_tags.hpp"

extern "C" {
#include <libavutil/pixdesc.h>
}

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>

#include "daemon/exchange/luma_chroma.hpp"
#include "daemon/exchange/video_color.hpp"
#include "daemon/set/problems.hpp"
#include "drivers/av.hpp"

namespace previz::exchange {
namespace {

// More than this is no lens's squeeze, and no camera's.
constexpr double longest_pixel = 8;

std::string lower(std::string text) {
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

std::string name_of(const char* name) {
  return name ? name : "unknown";
}

// libav puts any number of a file into its enumerations, where C++ must not read those beyond them.
// Returns `count`, which is no tag, for such a number.
template <typename Tag>
Tag tag_of(const Tag& field, Tag count) {
  int code = 0;
  static_assert(sizeof code == sizeof field);
  std::memcpy(&code, &field, sizeof code);
  return code >= 0 && code < count ? static_cast<Tag>(code) : count;
}

AVColorSpace usual_matrix(const AVFrame& frame) {
  return frame.height >= 720 ? AVCOL_SPC_BT709 : AVCOL_SPC_SMPTE170M;
}

// The logarithmic curves of cameras have no number in H.273: their files name them in words.
bool names_a_log_curve(const std::string& value) {
  static constexpr std::array names = {"log-c",     "logc",    "log c",     "s-log", "slog2",
                                       "slog3",     "v-log",   "c-log",     "clog2", "clog3",
                                       "canon log", "n-log",   "f-log",     "d-log", "apple log",
                                       "applelog",  "log3g10", "redlogfilm"};
  const std::string text = lower(value);
  return std::ranges::any_of(
      names, [&](const char* name) { return text.find(name) != std::string::npos; });
}

// Returns whether people write this of a clip, and not a camera.
bool is_free_text(const std::string& key) {
  static constexpr std::array keys = {
      "title",        "comment",  "description", "artist",           "author",
      "album",        "synopsis", "copyright",   "keywords",         "genre",
      "handler_name", "encoder",  "show",        "file_package_name"};
  const std::string name = lower(key);
  return std::ranges::any_of(keys, [&](const char* known) { return name.ends_with(known); });
}

void refuse_log_curves(const AVDictionary* metadata, const std::filesystem::path& file) {
  const AVDictionaryEntry* entry = nullptr;
  while ((entry = av_dict_get(metadata, "", entry, AV_DICT_IGNORE_SUFFIX)))
    if (!is_free_text(entry->key) && names_a_log_curve(entry->value))
      throw Error(
          file.string() + ": was filmed with a logarithmic curve: its " +
          set::printable(entry->key) + " is \"" + set::printable(entry->value) +
          "\". previzd has no table of it: render the clip to Rec. 709 or sRGB first, or give "
          "\"read_as\": {\"transfer\": \"as recorded\"} beside \"video\" in FRAMES.json, and the "
          "camera's curve as \"response\"");
}

[[noreturn]] void refuse(const std::filesystem::path& file, const std::string& what,
                         const std::string& filter, const std::string& member) {
  throw Error(file.string() + ": " + what + ", which previzd does not convert; convert the clip (" +
              "ffmpeg -i IN -vf zscale=" + filter + " OUT), or give \"read_as\": {\"" + member +
              "\": ...} beside \"video\" in FRAMES.json if the tag is wrong");
}

void read_colors(const AVFrame& frame, const ReadAs& read_as, const std::filesystem::path& file,
                 VideoTags& tags) {
  const auto format = AVPixelFormat(frame.format);
  const bool tagged_full = tag_of(frame.color_range, AVCOL_RANGE_NB) == AVCOL_RANGE_JPEG ||
                           has_range_in_its_name(format) ||
                           (tag_of(frame.color_range, AVCOL_RANGE_NB) == AVCOL_RANGE_UNSPECIFIED &&
                            (is_rgb(format) || is_gray(format)));
  tags.full_range = read_as.range ? *read_as.range == AVCOL_RANGE_JPEG : tagged_full;
  tags.matrix = read_as.matrix.value_or(tag_of(frame.colorspace, AVCOL_SPC_NB));
  if (tags.matrix == AVCOL_SPC_UNSPECIFIED) tags.matrix = usual_matrix(frame);
  if (!is_rgb(format) && !is_gray(format) && !luma_shares(tags.matrix))
    refuse(file, "has the colour matrix " + name_of(av_color_space_name(tags.matrix)), "matrix=709",
           "matrix");
  tags.transfer = read_as.keeps_signal
                      ? AVCOL_TRC_UNSPECIFIED
                      : read_as.transfer.value_or(tag_of(frame.color_trc, AVCOL_TRC_NB));
  if (!keeps_signal(tags.transfer) && !light_of(tags.transfer, 0))
    refuse(file,
           "has the transfer characteristics " + name_of(av_color_transfer_name(tags.transfer)),
           "transfer=709", "transfer");
  tags.primaries = read_as.primaries.value_or(tag_of(frame.color_primaries, AVCOL_PRI_NB));
  if (!rec709_from(tags.primaries))
    refuse(file, "has the primaries " + name_of(av_color_primaries_name(tags.primaries)),
           "primaries=709", "primaries");
}

std::optional<Orientation> orientation_in(const std::uint8_t* bytes, std::size_t size,
                                          const std::filesystem::path& file) {
  std::array<std::int32_t, 9> matrix{};
  if (!bytes || size < sizeof matrix) return std::nullopt;
  std::memcpy(matrix.data(), bytes, sizeof matrix);
  const auto orientation = display_orientation(matrix);
  if (!orientation)
    throw Error(file.string() +
                ": is to be shown turned by an angle other than 90, 180 or 270 degrees, which is "
                "not possible; give \"read_as\": {\"rotation_deg\": 0} beside \"video\" in "
                "FRAMES.json to read it as it was filmed");
  return orientation;
}

Orientation orientation_of(const AVFrame& frame, AVStream& stream,
                           const std::filesystem::path& file) {
  if (const AVFrameSideData* data = av_frame_get_side_data(&frame, AV_FRAME_DATA_DISPLAYMATRIX))
    if (const auto found = orientation_in(data->data, data->size, file)) return *found;
  const std::span<const std::uint8_t> data = av::side_data(stream, AV_PKT_DATA_DISPLAYMATRIX);
  return orientation_in(data.data(), data.size(), file).value_or(Orientation{});
}

AVRational pixel_aspect_of(const AVRational& said, const std::filesystem::path& file) {
  if (said.num <= 0 || said.den <= 0) return {1, 1};
  const double ratio = av_q2d(said);
  if (ratio > longest_pixel || ratio < 1 / longest_pixel)
    throw Error(fmt::format(
        "{}: its pixels are said to be {}:{} wide to high, which no camera has; give \"read_as\": "
        "{{\"pixel_aspect\": [1, 1]}} beside \"video\" in FRAMES.json if they are square",
        file.string(), said.num, said.den));
  return said;
}

const char* assumed(bool given, bool tagged) {
  return given ? " (as FRAMES.json says)" : tagged ? "" : " (assumed)";
}

std::string words_of(const AVFrame& frame, const ReadAs& read_as, const VideoTags& tags) {
  const auto format = AVPixelFormat(frame.format);
  std::string text = name_of(av_get_pix_fmt_name(format));
  if (!is_rgb(format) && !is_gray(format))
    text += ", matrix " + name_of(av_color_space_name(tags.matrix)) +
            assumed(read_as.matrix.has_value(),
                    tag_of(frame.colorspace, AVCOL_SPC_NB) != AVCOL_SPC_UNSPECIFIED);
  const bool range_tagged = tag_of(frame.color_range, AVCOL_RANGE_NB) != AVCOL_RANGE_UNSPECIFIED ||
                            has_range_in_its_name(format);
  text += std::string(tags.full_range ? ", full range" : ", limited range") +
          assumed(read_as.range.has_value(), range_tagged);
  if (read_as.keeps_signal)
    text += ", transfer as recorded (as FRAMES.json says)";
  else if (tags.transfer == AVCOL_TRC_UNSPECIFIED)
    text += ", no transfer (the response curve holds; without one sRGB is assumed)";
  else
    text += ", transfer " + name_of(av_color_transfer_name(tags.transfer)) +
            assumed(read_as.transfer.has_value(), true) +
            (keeps_signal(tags.transfer) ? " (kept: the response curve holds, or sRGB's)" : "");
  if (!is_gray(format))
    text += ", primaries " + (tags.primaries == AVCOL_PRI_UNSPECIFIED
                                  ? std::string("bt709 (assumed)")
                                  : name_of(av_color_primaries_name(tags.primaries)) +
                                        assumed(read_as.primaries.has_value(), true));
  return text;
}

}  // namespace

bool has_range_in_its_name(AVPixelFormat format) {
  return std::string_view(name_of(av_get_pix_fmt_name(format))).starts_with("yuvj");
}

bool is_gray(AVPixelFormat format) {
  const AVPixFmtDescriptor* description = av_pix_fmt_desc_get(format);
  return description && description->nb_components <= 2 && description->comp[0].depth <= 16 &&
         !(description->flags & (AV_PIX_FMT_FLAG_PAL | AV_PIX_FMT_FLAG_BAYER |
                                 AV_PIX_FMT_FLAG_BITSTREAM | AV_PIX_FMT_FLAG_FLOAT));
}

bool is_rgb(AVPixelFormat format) {
  const AVPixFmtDescriptor* description = av_pix_fmt_desc_get(format);
  // swscale makes RGB of digital cinema's XYZ.
  if (format == AV_PIX_FMT_XYZ12LE || format == AV_PIX_FMT_XYZ12BE) return true;
  return description &&
         description->flags & (AV_PIX_FMT_FLAG_RGB | AV_PIX_FMT_FLAG_PAL | AV_PIX_FMT_FLAG_BAYER);
}

VideoTags tags_of(const AVFrame& frame, AVStream& stream, AVFormatContext& context,
                  const ReadAs& read_as, const std::filesystem::path& file) {
  VideoTags tags;
  const bool curve_is_given = read_as.keeps_signal || read_as.transfer;
  if (!curve_is_given)
    for (const AVDictionary* metadata : {context.metadata, stream.metadata, frame.metadata})
      refuse_log_curves(metadata, file);
  read_colors(frame, read_as, file, tags);
  tags.orientation =
      read_as.orientation ? *read_as.orientation : orientation_of(frame, stream, file);
  tags.pixel_aspect = pixel_aspect_of(read_as.pixel_aspect.value_or(av_guess_sample_aspect_ratio(
                                          &context, &stream, const_cast<AVFrame*>(&frame))),
                                      file);
  tags.words = words_of(frame, read_as, tags);
  return tags;
}

}  // namespace previz::exchange
