#include "daemon/tools/exchange/video_tags.hpp"

extern "C" {
#include <libavutil/pixdesc.h>
}

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>

#include "daemon/core/session/av.hpp"
#include "daemon/core/set/problems.hpp"
#include "daemon/tools/exchange/luma_chroma.hpp"
#include "daemon/tools/exchange/video_color.hpp"

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

// A tag, and who says it, in words: "" for the frames themselves.
template <typename Tag>
struct Choice {
  Tag tag;
  std::string source;
};

// `nothing` is the tag's own value for "unspecified".
template <typename Tag, typename Name>
Choice<Tag> choose(const std::optional<Tag>& given, Tag frame, Tag container, Tag nothing,
                   Name name) {
  if (given) return {*given, " (as FRAMES.json says)"};
  if (frame == nothing && container == nothing) return {nothing, " (assumed)"};
  if (frame == nothing) return {container, " (from the container)"};
  if (container == nothing || container == frame) return {frame, ""};
  return {frame, " (from the frames; the container says " + name_of(name(container)) + ")"};
}

// libav's decoders of these name a matrix whatever the file says (JPEG and VP8 have none but that
// of Rec. 601), or one that encoders do not set (DNxHD).
bool decoder_assumes_matrix(AVCodecID codec) {
  return codec == AV_CODEC_ID_MJPEG || codec == AV_CODEC_ID_VP8 || codec == AV_CODEC_ID_DNXHD;
}

// Numbers that H.273 reserves, as where a program wrote 0 for "unknown", say nothing.
NamedColors without_reserved(NamedColors named) {
  if (named.matrix == AVCOL_SPC_RESERVED) named.matrix = AVCOL_SPC_UNSPECIFIED;
  if (named.transfer == AVCOL_TRC_RESERVED0 || named.transfer == AVCOL_TRC_RESERVED)
    named.transfer = AVCOL_TRC_UNSPECIFIED;
  if (named.primaries == AVCOL_PRI_RESERVED0 || named.primaries == AVCOL_PRI_RESERVED)
    named.primaries = AVCOL_PRI_UNSPECIFIED;
  return named;
}

// Reads the colours into `tags`, with the words for them.
void read_colors(const AVFrame& frame, AVCodecID codec, const NamedColors& container,
                 const ReadAs& read_as, const std::filesystem::path& file, VideoTags& tags) {
  const auto format = AVPixelFormat(frame.format);
  const bool has_matrix = !is_rgb(format) && !is_gray(format);
  tags.words = name_of(av_get_pix_fmt_name(format));

  const NamedColors own = without_reserved(
      {tag_of(frame.color_range, AVCOL_RANGE_NB), tag_of(frame.colorspace, AVCOL_SPC_NB),
       tag_of(frame.color_trc, AVCOL_TRC_NB), tag_of(frame.color_primaries, AVCOL_PRI_NB)});
  AVColorSpace of_frame = own.matrix;
  if (decoder_assumes_matrix(codec) && container.matrix != AVCOL_SPC_UNSPECIFIED &&
      container.matrix != AVCOL_SPC_RGB)
    of_frame = AVCOL_SPC_UNSPECIFIED;
  // 0 is the matrix of RGB, and of whoever wrote 0 for "unknown".
  if (has_matrix && of_frame == AVCOL_SPC_RGB) of_frame = AVCOL_SPC_UNSPECIFIED;
  const AVColorSpace of_container =
      has_matrix && container.matrix == AVCOL_SPC_RGB ? AVCOL_SPC_UNSPECIFIED : container.matrix;
  auto matrix = choose(read_as.matrix, of_frame, of_container, AVCOL_SPC_UNSPECIFIED,
                       [](AVColorSpace tag) { return av_color_space_name(tag); });
  tags.matrix = matrix.tag == AVCOL_SPC_UNSPECIFIED ? usual_matrix(frame) : matrix.tag;
  if (has_matrix) {
    if (!luma_shares(tags.matrix))
      refuse(file, "has the colour matrix " + name_of(av_color_space_name(tags.matrix)),
             "matrix=709", "matrix");
    tags.words += ", matrix " + name_of(av_color_space_name(tags.matrix)) + matrix.source;
  }

  auto range = choose(read_as.range, has_range_in_its_name(format) ? AVCOL_RANGE_JPEG : own.range,
                      container.range, AVCOL_RANGE_UNSPECIFIED, [](AVColorRange tag) {
                        return tag == AVCOL_RANGE_JPEG ? "full" : "limited";
                      });
  tags.full_range =
      range.tag == AVCOL_RANGE_UNSPECIFIED ? !has_matrix : range.tag == AVCOL_RANGE_JPEG;
  tags.words += (tags.full_range ? ", full range" : ", limited range") + range.source;

  auto transfer = choose(read_as.transfer, own.transfer, container.transfer, AVCOL_TRC_UNSPECIFIED,
                         [](AVColorTransferCharacteristic t) { return av_color_transfer_name(t); });
  tags.transfer = read_as.keeps_signal ? AVCOL_TRC_UNSPECIFIED : transfer.tag;
  if (!keeps_signal(tags.transfer) && !light_of(tags.transfer, 0))
    refuse(file,
           "has the transfer characteristics " + name_of(av_color_transfer_name(tags.transfer)),
           "transfer=709", "transfer");
  if (read_as.keeps_signal)
    tags.words += ", transfer as recorded (as FRAMES.json says)";
  else if (tags.transfer == AVCOL_TRC_UNSPECIFIED)
    tags.words += ", no transfer (the response curve holds; without one sRGB is assumed)";
  else
    tags.words +=
        ", transfer " + name_of(av_color_transfer_name(tags.transfer)) + transfer.source +
        (keeps_signal(tags.transfer) ? " (kept: the response curve holds, or sRGB's)" : "");

  auto primaries =
      choose(read_as.primaries, own.primaries, container.primaries, AVCOL_PRI_UNSPECIFIED,
             [](AVColorPrimaries tag) { return av_color_primaries_name(tag); });
  tags.primaries = primaries.tag;
  if (!rec709_from(tags.primaries))
    refuse(file, "has the primaries " + name_of(av_color_primaries_name(tags.primaries)),
           "primaries=709", "primaries");
  if (!is_gray(format))
    tags.words += ", primaries " +
                  (tags.primaries == AVCOL_PRI_UNSPECIFIED
                       ? std::string("bt709")
                       : name_of(av_color_primaries_name(tags.primaries))) +
                  primaries.source;
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

NamedColors named_colors(const AVCodecParameters& said) {
  return without_reserved(
      {tag_of(said.color_range, AVCOL_RANGE_NB), tag_of(said.color_space, AVCOL_SPC_NB),
       tag_of(said.color_trc, AVCOL_TRC_NB), tag_of(said.color_primaries, AVCOL_PRI_NB)});
}

VideoTags tags_of(const AVFrame& frame, AVStream& stream, AVFormatContext& context,
                  const NamedColors& container, const ReadAs& read_as,
                  const std::filesystem::path& file) {
  VideoTags tags;
  const bool curve_is_given = read_as.keeps_signal || read_as.transfer;
  if (!curve_is_given)
    for (const AVDictionary* metadata : {context.metadata, stream.metadata, frame.metadata})
      refuse_log_curves(metadata, file);
  read_colors(frame, stream.codecpar->codec_id, container, read_as, file, tags);
  tags.orientation =
      read_as.orientation ? *read_as.orientation : orientation_of(frame, stream, file);
  tags.pixel_aspect = pixel_aspect_of(read_as.pixel_aspect.value_or(av_guess_sample_aspect_ratio(
                                          &context, &stream, const_cast<AVFrame*>(&frame))),
                                      file);
  return tags;
}

}  // namespace previz::exchange
