#include "daemon/core/output/video.hpp"

#include <algorithm>
#include <array>
#include <optional>

#include "daemon/core/session/av.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/nominal_rate.hpp"

extern "C" {
#include <libavutil/opt.h>
}

namespace previz::output {
namespace {

// This clock is fine enough for jittered capture times, and below MPEG-4's limit of 65535 ticks a
// second.
constexpr AVRational video_clock{1, 60000};

// Opens an encoder for pictures of this size; returns null if libav cannot.
av::Codec open_encoder(const VideoCodec& codec, int width, int height) {
  const AVCodec* found = avcodec_find_encoder_by_name(codec.encoder.c_str());
  if (!found) return nullptr;
  av::Codec context(av::made(avcodec_alloc_context3(found)));
  const bool odd = width % 2 != 0 || height % 2 != 0;
  context->width = width;
  context->height = height;
  context->time_base = video_clock;
  context->framerate = {30, 1};  // a guess for the level in the header; the times are exact
  context->pix_fmt = odd && codec.encoder != "mpeg4" ? AV_PIX_FMT_YUV444P : AV_PIX_FMT_YUV420P;
  context->color_range = AVCOL_RANGE_MPEG;
  context->color_primaries = AVCOL_PRI_BT709;
  context->color_trc = AVCOL_TRC_IEC61966_2_1;
  context->colorspace = AVCOL_SPC_BT709;
  context->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  context->log_level_offset = AV_LOG_VERBOSE - AV_LOG_INFO;  // x264 is very talkative otherwise
  if (codec.encoder == "libx264") {
    av_opt_set(context->priv_data, "preset", "medium", 0);
    av_opt_set(context->priv_data, "crf", "17", 0);
  } else if (codec.encoder == "mpeg4") {
    context->flags |= AV_CODEC_FLAG_QSCALE;
    context->global_quality = 3 * FF_QP2LAMBDA;
  }
  if (avcodec_open2(context.get(), found, nullptr) < 0) return nullptr;
  return context;
}

std::vector<std::uint8_t> to_rgb8(const Plate& picture) {
  std::vector<std::uint8_t> rgb(picture.samples.size());
  std::transform(picture.samples.begin(), picture.samples.end(), rgb.begin(), [&](auto sample) {
    return static_cast<std::uint8_t>(picture.bits == 16 ? (sample + 128u) / 257u : sample);
  });
  return rgb;
}

}  // namespace

std::vector<VideoCodec> review_codecs() {
  const std::array candidates{
      VideoCodec{"libx264", "H.264 (libx264)", "mp4", ".mp4"},
      VideoCodec{"mpeg4", "MPEG-4 part 2", "mp4", ".mp4"},
      VideoCodec{"ffv1", "FFV1, lossless", "matroska", ".mkv"},
  };
  std::vector<VideoCodec> available;
  for (const VideoCodec& codec : candidates)
    if (open_encoder(codec, 64, 64)) available.push_back(codec);
  return available;
}

struct VideoWriter::Impl {
  std::filesystem::path path;
  std::optional<session::Draft> draft;
  av::Codec encoder;
  av::Muxer file;
  av::Scaler converter;
  av::Picture frame{av::made(av_frame_alloc())};
  av::Packet packet{av::made(av_packet_alloc())};
  AVStream* stream = nullptr;  // belongs to `file`
  std::optional<std::int64_t> first_timestamp_ns;
  std::int64_t last_tick = -1;
  std::int64_t last_interval = video_clock.den / 25;  // for a single picture

  void check(int result, const char* what) const { av::check(result, path, what); }

  // Encodes a picture; null ends the stream.
  void encode(const AVFrame* picture) {
    check(avcodec_send_frame(encoder.get(), picture), "cannot be encoded");
    for (;;) {
      const int result = avcodec_receive_packet(encoder.get(), packet.get());
      if (result == AVERROR(EAGAIN) || result == AVERROR_EOF) return;
      check(result, "cannot be encoded");
      // Players drop a last picture without a duration; earlier ones last until the next.
      packet->duration = last_interval;
      av_packet_rescale_ts(packet.get(), encoder->time_base, stream->time_base);
      packet->stream_index = stream->index;
      check(av_interleaved_write_frame(file.get(), packet.get()), "cannot be written");
    }
  }
};

VideoWriter::VideoWriter(const std::filesystem::path& stem, int width, int height,
                         const VideoCodec& codec, const session::TakeClock& clock,
                         std::int64_t first_ns)
    : impl_(std::make_unique<Impl>()) {
  impl_->path = std::filesystem::path(stem) += codec.extension;
  impl_->encoder = open_encoder(codec, width, height);
  if (!impl_->encoder)
    throw Error(impl_->path.string() + ": libav cannot encode " + std::to_string(width) + "x" +
                std::to_string(height) + " as " + codec.description);

  impl_->draft.emplace(impl_->path);
  AVFormatContext* file = nullptr;
  const std::string url = av::url_of(impl_->draft->path());
  impl_->check(avformat_alloc_output_context2(&file, nullptr, codec.container.c_str(), url.c_str()),
               "cannot be created");
  impl_->file.reset(file);
  impl_->stream = av::made(avformat_new_stream(file, nullptr));
  impl_->stream->time_base = video_clock;
  if (clock.fps > 0) {
    const session::RateFraction rate = session::fraction_of(clock.fps);
    impl_->stream->avg_frame_rate = {rate.frames, rate.seconds};
  }
  if (const auto timecode = clock.at(first_ns); timecode && counts_frames(clock))
    av_dict_set(&impl_->stream->metadata, "timecode", session::words_of(*timecode).c_str(), 0);
  impl_->check(avcodec_parameters_from_context(impl_->stream->codecpar, impl_->encoder.get()),
               "cannot be created");
  impl_->check(avio_open(&file->pb, url.c_str(), AVIO_FLAG_WRITE), "cannot be opened");
  impl_->check(avformat_write_header(file, nullptr), "cannot be written");

  impl_->frame->format = impl_->encoder->pix_fmt;
  impl_->frame->width = width;
  impl_->frame->height = height;
  impl_->check(av_frame_get_buffer(impl_->frame.get(), 0), "is out of memory for a picture");
  impl_->converter.reset(sws_getContext(
      width, height, AV_PIX_FMT_RGB24, width, height, impl_->encoder->pix_fmt,
      SWS_BICUBIC | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INP, nullptr, nullptr, nullptr));
  const int* bt709 = sws_getCoefficients(SWS_CS_ITU709);
  constexpr int unity = 1 << 16;
  sws_setColorspaceDetails(impl_->converter.get(), bt709, 1, bt709, 0, 0, unity, unity);
}

VideoWriter::~VideoWriter() = default;

void VideoWriter::write(const Plate& picture, std::int64_t timestamp_ns) {
  if (picture.width != impl_->frame->width || picture.height != impl_->frame->height)
    throw Error(impl_->path.string() + ": a picture of " + std::to_string(picture.width) + "x" +
                std::to_string(picture.height) + " does not fit into a video of " +
                std::to_string(impl_->frame->width) + "x" + std::to_string(impl_->frame->height));
  if (!impl_->first_timestamp_ns) impl_->first_timestamp_ns = timestamp_ns;
  const std::int64_t tick = av_rescale_q(timestamp_ns - *impl_->first_timestamp_ns,
                                         AVRational{1, 1'000'000'000}, video_clock);
  if (tick <= impl_->last_tick)
    throw Error(impl_->path.string() + ": the time " + std::to_string(timestamp_ns) +
                " ns is not later than the previous picture");
  if (impl_->last_tick >= 0) impl_->last_interval = tick - impl_->last_tick;
  impl_->last_tick = tick;

  const std::vector<std::uint8_t> rgb = to_rgb8(picture);
  impl_->check(av_frame_make_writable(impl_->frame.get()), "is out of memory for a picture");
  const std::uint8_t* rows = rgb.data();
  const int stride = 3 * picture.width;
  sws_scale(impl_->converter.get(), &rows, &stride, 0, picture.height, impl_->frame->data,
            impl_->frame->linesize);
  impl_->frame->pts = tick;
  impl_->encode(impl_->frame.get());
}

std::filesystem::path VideoWriter::close() {
  impl_->encode(nullptr);
  impl_->check(av_write_trailer(impl_->file.get()), "cannot be finished");
  impl_->check(avio_closep(&impl_->file->pb), "cannot be finished");
  impl_->file.reset();
  impl_->draft->put();
  return impl_->path;
}

}  // namespace previz::output
