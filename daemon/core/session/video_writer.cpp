#include "daemon/core/session/video_writer.hpp"

#include <fcntl.h>

#include <algorithm>

extern "C" {
#include <libavutil/opt.h>
}

#include "daemon/core/session/av.hpp"
#include "daemon/core/session/crc32.hpp"
#include "daemon/core/session/ffv1.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/core/session/samples.hpp"

namespace previz::session {
namespace {

constexpr AVRational milliseconds{1, 1000};

AVPixelFormat raw_format(PixelFormat format) {
  return format == PixelFormat::rgb8 ? AV_PIX_FMT_RGB24 : encoder_format(format);
}

// Describes samples that are written as they are.
void describe_raw(AVCodecParameters& parameters, const StreamFormat& format) {
  parameters.codec_type = AVMEDIA_TYPE_VIDEO;
  parameters.codec_id = AV_CODEC_ID_RAWVIDEO;
  parameters.width = format.width;
  parameters.height = format.height;
  parameters.format = raw_format(format.format);
}

// `encoder` is null for raw video.
av::Muxer open_muxer(const StreamFormat& format, const AVCodecContext* encoder,
                     const std::filesystem::path& file) {
  AVFormatContext* context = nullptr;
  const std::string url = av::url_of(file);
  av::check(avformat_alloc_output_context2(&context, nullptr, "matroska", url.c_str()), file,
            "Matroska cannot be started");
  av::Muxer muxer(context);
  AVStream* stream = av::made(avformat_new_stream(context, nullptr));
  if (encoder)
    av::check(avcodec_parameters_from_context(stream->codecpar, encoder), file, "cannot be set up");
  else
    describe_raw(*stream->codecpar, format);
  stream->time_base = milliseconds;
  context->flags |= AVFMT_FLAG_BITEXACT;  // the same frames make the same file
  av::check(avio_open(&context->pb, url.c_str(), AVIO_FLAG_WRITE), file, "cannot be created");
  // The lines beside the video have the checksum of each packet.
  av::check(av_opt_set(context->priv_data, "write_crc32", "0", 0), file, "cannot be set up");
  av::check(avformat_init_output(context, nullptr), file, "cannot be set up");
  // libav's list of tags for Matroska lacks those of RGB, with which it reads them.
  if (!encoder)
    stream->codecpar->codec_tag = avcodec_pix_fmt_to_codec_tag(raw_format(format.format));
  av::check(avformat_write_header(context, nullptr), file, "its header cannot be written");
  return muxer;
}

}  // namespace

struct VideoWriter::Impl {
  std::filesystem::path file;
  StreamFormat format;
  av::Codec encoder;
  av::Muxer muxer;
  OpenFile same_file;  // the same file once more: libav does not hand out its own for sync
  av::Picture picture;
  av::Packet packet;
  std::int64_t first_ns = 0;
  std::int64_t last_ms = -1;

  Impl(const std::filesystem::path& path, const StreamFormat& stream_format)
      : file(path),
        format(stream_format),
        encoder(format.codec == VideoCodec::ffv1 ? open_ffv1_encoder(format, file) : nullptr),
        muxer(open_muxer(format, encoder.get(), file)),
        same_file(file, O_RDONLY),
        picture(av::made(av_frame_alloc())),
        packet(av::made(av_packet_alloc())) {
    if (!encoder) return;
    picture->width = format.width;
    picture->height = format.height;
    picture->format = encoder->pix_fmt;
    av::check(av_frame_get_buffer(picture.get(), 0), file, "no memory for a picture");
  }

  // Matroska counts milliseconds from the first frame. Frames that come closer, or whose device
  // clock jumped back, are put a millisecond after the frame before.
  std::int64_t next_ms(std::int64_t timestamp_ns) {
    if (last_ms < 0) first_ns = timestamp_ns;
    const double elapsed_ms =
        (static_cast<double>(timestamp_ns) - static_cast<double>(first_ns)) * 1e-6;
    constexpr double one_year_ms = 366.0 * 86'400'000.0;
    const auto wanted = static_cast<std::int64_t>(std::clamp(elapsed_ms, 0.0, one_year_ms));
    return last_ms = std::max(last_ms + 1, wanted);
  }

  // Each of these makes the packet of a frame.
  void encode(const Frame& frame, std::int64_t time_ms) {
    av::check(av_frame_make_writable(picture.get()), file, "no memory for a picture");
    pack(frame.bytes, frame.format, *picture);
    picture->pts = time_ms;
    av::check(avcodec_send_frame(encoder.get(), picture.get()), file, "FFV1 failed");
    av::check(avcodec_receive_packet(encoder.get(), packet.get()), file, "FFV1 failed");
  }

  void take_as_is(const Frame& frame, std::int64_t time_ms) {
    // The muxer reads these bytes and does not keep them.
    packet->data = const_cast<std::uint8_t*>(frame.bytes.data());
    packet->size = static_cast<int>(frame.bytes.size());
    packet->flags = AV_PKT_FLAG_KEY;
    packet->pts = packet->dts = time_ms;
  }

  // Writes out what the muxer holds back, so that the kernel has the whole frame.
  void flush() {
    av::check(av_write_frame(muxer.get(), nullptr), file, "cannot be written");
    avio_flush(muxer->pb);
    av::check(muxer->pb->error, file, "cannot be written");
  }
};

VideoWriter::VideoWriter(const std::filesystem::path& file, const StreamFormat& format)
    : impl_(std::make_unique<Impl>(file, format)) {
  impl_->flush();
}

VideoWriter::~VideoWriter() = default;

VideoWriter::Stamp VideoWriter::write(const Frame& frame) {
  Impl& s = *impl_;
  const std::int64_t time_ms = s.next_ms(frame.timestamp_ns);
  s.encoder ? s.encode(frame, time_ms) : s.take_as_is(frame, time_ms);
  const Stamp stamp{time_ms, crc32(av::bytes_of(*s.packet))};
  s.packet->stream_index = 0;
  av_packet_rescale_ts(s.packet.get(), milliseconds, s.muxer->streams[0]->time_base);
  const int written = av_write_frame(s.muxer.get(), s.packet.get());
  av_packet_unref(s.packet.get());
  av::check(written, s.file, "cannot be written");
  s.flush();
  return stamp;
}

void VideoWriter::sync() const {
  impl_->same_file.sync();
}

void VideoWriter::finish() {
  av::check(av_write_trailer(impl_->muxer.get()), impl_->file, "its index cannot be written");
  avio_flush(impl_->muxer->pb);
  av::check(impl_->muxer->pb->error, impl_->file, "cannot be written");
  sync();
}

}  // namespace previz::session
