extern "C" {
#include <libavutil/imgutils.h>
#include <libavutil/pixdesc.h>
}

#include <array>
#include <vector>

#include "daemon/exchange/footage.hpp"
#include "drivers/av.hpp"

namespace previz::exchange {
namespace {

// The session's format for the picture, and libav's name for that format.
struct Target {
  PixelFormat format;
  AVPixelFormat av_format;
};

AVColorSpace matrix_of(const AVFrame& frame) {
  if (frame.colorspace != AVCOL_SPC_UNSPECIFIED) return frame.colorspace;
  return frame.height >= 720 ? AVCOL_SPC_BT709 : AVCOL_SPC_SMPTE170M;
}

// Older formats say "full range" in their names; swscale takes that as a setting.
AVPixelFormat without_range(AVPixelFormat format) {
  switch (format) {
    case AV_PIX_FMT_YUVJ420P:
      return AV_PIX_FMT_YUV420P;
    case AV_PIX_FMT_YUVJ422P:
      return AV_PIX_FMT_YUV422P;
    case AV_PIX_FMT_YUVJ444P:
      return AV_PIX_FMT_YUV444P;
    default:
      return format;
  }
}

bool is_full_range(const AVFrame& frame) {
  const auto format = AVPixelFormat(frame.format);
  return frame.color_range == AVCOL_RANGE_JPEG || format != without_range(format);
}

Target target_of(const AVFrame& frame) {
  const auto format = AVPixelFormat(frame.format);
  if (format == AV_PIX_FMT_GRAY8 && is_full_range(frame)) return {PixelFormat::gray8, format};
  if (format == AV_PIX_FMT_GRAY16LE && is_full_range(frame)) return {PixelFormat::gray16, format};
  if (format == AV_PIX_FMT_YUV422P && matrix_of(frame) == AVCOL_SPC_BT709 && !is_full_range(frame))
    return {PixelFormat::yuv422p8, format};
  const AVPixFmtDescriptor* description = av_pix_fmt_desc_get(format);
  const bool deep = description && description->comp[0].depth > 8;
  return deep ? Target{PixelFormat::rgb16, AV_PIX_FMT_RGB48LE}
              : Target{PixelFormat::rgb8, AV_PIX_FMT_RGB24};
}

std::string describe(const AVFrame& frame) {
  const char* format = av_get_pix_fmt_name(AVPixelFormat(frame.format));
  std::string text = format ? format : "an unknown format";
  const AVPixFmtDescriptor* description = av_pix_fmt_desc_get(AVPixelFormat(frame.format));
  if (description && description->flags & AV_PIX_FMT_FLAG_RGB) return text;
  const char* matrix = av_color_space_name(matrix_of(frame));
  return text + ", matrix " + (matrix ? matrix : "unknown") +
         (frame.colorspace == AVCOL_SPC_UNSPECIFIED ? " (assumed)" : "") +
         (is_full_range(frame) ? ", full range" : ", limited range");
}

// What editors and cameras write. libav knows hundreds of further formats, among them play lists
// that name other files and addresses of networks, and decoders that nobody looks after.
constexpr const char* allowed_protocols = "file";
constexpr const char* allowed_formats =
    "mov,matroska,avi,mxf,mpegts,mpeg,ogg,nut,dv,gxf,asf,yuv4mpegpipe";
constexpr const char* allowed_codecs =
    "ffv1,prores,dnxhd,cfhd,h264,hevc,libdav1d,av1,vp8,vp9,mjpeg,png,jpeg2000,rawvideo,v210,v410,"
    "r210,"
    "dvvideo,mpeg1video,mpeg2video,mpeg4,theora,huffyuv,ffvhuff,utvideo,qtrle,wrapped_avframe";

// Options for opening a file or a decoder, with the limits of what is read.
class Limits {
 public:
  Limits() {
    av_dict_set(&options_, "protocol_whitelist", allowed_protocols, 0);
    av_dict_set(&options_, "format_whitelist", allowed_formats, 0);
    av_dict_set(&options_, "codec_whitelist", allowed_codecs, 0);
    av_dict_set_int(&options_, "max_pixels", static_cast<std::int64_t>(most_pixels), 0);
  }
  ~Limits() { av_dict_free(&options_); }
  Limits(const Limits&) = delete;
  Limits& operator=(const Limits&) = delete;
  AVDictionary** get() { return &options_; }

 private:
  AVDictionary* options_ = nullptr;
};

class VideoFile final : public Footage {
 public:
  explicit VideoFile(const std::filesystem::path& file) : file_(file) {
    AVFormatContext* context = nullptr;
    // "file:" keeps a name with a colon from being taken for another protocol.
    const std::string url = "file:" + std::filesystem::absolute(file).string();
    av::check(avformat_open_input(&context, url.c_str(), nullptr, Limits().get()), file,
              "cannot be read as a video");
    demuxer_.reset(context);
    probe(*context);
    const AVCodec* codec = nullptr;
    track_ = av::check(av_find_best_stream(context, AVMEDIA_TYPE_VIDEO, -1, -1, &codec, 0), file,
                       "holds no video that can be decoded");
    decoder_.reset(avcodec_alloc_context3(codec));
    av::check(avcodec_parameters_to_context(decoder_.get(), context->streams[track_]->codecpar),
              file, "cannot be decoded");
    decoder_->thread_count = 0;  // 0: one thread per core
    decoder_->err_recognition = AV_EF_EXPLODE;
    av::check(avcodec_open2(decoder_.get(), codec, Limits().get()), file, "cannot be decoded");
  }

  std::optional<Picture> next() override {
    if (!decode()) return std::nullopt;
    const std::string name = file_.string() + " frame " + std::to_string(index_++);
    if (frame_->decode_error_flags || frame_->flags & AV_FRAME_FLAG_CORRUPT)
      throw Error(name + ": is damaged");
    const Target target = target_of(*frame_);
    if (index_ == 1) note(target);
    Picture picture{target.format, frame_->width, frame_->height, {}, name, container_ns()};
    picture.bytes.resize(frame_bytes(target.format, picture.width, picture.height));
    if (target.av_format == AVPixelFormat(frame_->format))
      copy(picture);
    else
      convert(target.av_format, picture);
    return picture;
  }

  std::vector<std::string> notes() const override { return notes_; }

 private:
  // Looks into the streams, with decoders that have the limits, too.
  void probe(AVFormatContext& context) const {
    std::vector<Limits> limits(context.nb_streams);
    std::vector<AVDictionary*> options;
    for (Limits& of_stream : limits) options.push_back(*of_stream.get());
    const int result = avformat_find_stream_info(&context, options.data());
    for (std::size_t i = 0; i < limits.size(); ++i) *limits[i].get() = options[i];  // what is left
    av::check(result, file_, "cannot be read as a video");
  }

  // Returns false after the last frame.
  bool decode() {
    for (;;) {
      const int got = avcodec_receive_frame(decoder_.get(), frame_.get());
      if (got == AVERROR_EOF) return false;
      if (got != AVERROR(EAGAIN)) return av::check(got, file_, failure()), true;
      const int read = av_read_frame(demuxer_.get(), packet_.get());
      if (read == AVERROR_EOF) {
        av::check(avcodec_send_packet(decoder_.get(), nullptr), file_, failure());
        continue;
      }
      av::check(read, file_, failure());
      if (packet_->stream_index == track_)
        av::check(avcodec_send_packet(decoder_.get(), packet_.get()), file_, failure());
      av_packet_unref(packet_.get());
    }
  }

  std::string failure() const {
    return "cannot be decoded after frame " + std::to_string(index_) + " of it";
  }

  std::optional<std::int64_t> container_ns() {
    const std::int64_t pts = frame_->best_effort_timestamp;
    if (pts == AV_NOPTS_VALUE) return std::nullopt;
    if (!first_pts_) first_pts_ = pts;
    return av_rescale_q(pts - *first_pts_, demuxer_->streams[track_]->time_base,
                        {1, 1'000'000'000});
  }

  void note(const Target& target) {
    const std::string video = file_.string() + ": " + describe(*frame_);
    notes_.push_back(video + (target.av_format == AVPixelFormat(frame_->format)
                                  ? ", kept as it is"
                                  : std::string(", converted to ") + to_string(target.format)));
    if (frame_->interlaced_frame)
      notes_.push_back(file_.string() + ": is interlaced; its fields are kept as they are");
  }

  void copy(Picture& picture) const {
    av::check(av_image_copy_to_buffer(picture.bytes.data(), static_cast<int>(picture.bytes.size()),
                                      frame_->data, frame_->linesize, AVPixelFormat(frame_->format),
                                      picture.width, picture.height, 1),
              file_, "cannot be copied");
  }

  void convert(AVPixelFormat format, Picture& picture) {
    scaler_.reset(sws_getCachedContext(
        scaler_.release(), picture.width, picture.height,
        without_range(AVPixelFormat(frame_->format)), picture.width, picture.height, format,
        SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_FULL_CHR_H_INP | SWS_BITEXACT,
        nullptr, nullptr, nullptr));
    if (!scaler_)
      throw Error(picture.name + ": " + describe(*frame_) + " cannot be converted to RGB");
    constexpr int one = 1 << 16;
    sws_setColorspaceDetails(scaler_.get(), sws_getCoefficients(matrix_of(*frame_)),
                             is_full_range(*frame_), sws_getCoefficients(AVCOL_SPC_BT709), 1, 0,
                             one, one);
    std::array<std::uint8_t*, 4> planes{};
    std::array<int, 4> strides{};
    av_image_fill_arrays(planes.data(), strides.data(), picture.bytes.data(), format, picture.width,
                         picture.height, 1);
    sws_scale(scaler_.get(), frame_->data, frame_->linesize, 0, picture.height, planes.data(),
              strides.data());
  }

  std::filesystem::path file_;
  av::Demuxer demuxer_;
  int track_ = 0;
  av::Codec decoder_;
  av::Packet packet_{av_packet_alloc()};
  av::Picture frame_{av_frame_alloc()};
  av::Scaler scaler_;
  std::uint64_t index_ = 0;
  std::optional<std::int64_t> first_pts_;
  std::vector<std::string> notes_;
};

}  // namespace

std::unique_ptr<Footage> open_video(const std::filesystem::path& file) {
  return std::make_unique<VideoFile>(file);
}

}  // namespace previz::exchange
