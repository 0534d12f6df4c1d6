#include "daemon/core/session/ffv1.hpp"

#include <algorithm>
#include <limits>
#include <thread>

extern "C" {
#include <libavutil/opt.h>
}

#include "daemon/core/session/samples.hpp"

namespace previz::session {
namespace {

struct ParametersCloser {
  void operator()(AVCodecParameters* parameters) const { avcodec_parameters_free(&parameters); }
};

// FFV1 codes a picture in independent slices, each on one thread. libav's encoder knows only some
// counts: 1 up to 352x288 pixels, 4 and 16 always.
int slice_count(const StreamFormat& format) {
  if (format.width <= 352 && format.height <= 288)
    return format.width * format.height < 128 * 128 ? 1 : 4;
  return std::min(format.width, format.height) < 480 ? 4 : 16;
}

}  // namespace

av::Codec open_ffv1_encoder(const StreamFormat& format, const std::filesystem::path& file) {
  const AVCodec* codec = avcodec_find_encoder(AV_CODEC_ID_FFV1);
  if (!codec) throw Error(file.string() + ": this libavcodec has no FFV1 encoder");
  av::Codec encoder(av::made(avcodec_alloc_context3(codec)));
  const int slices = slice_count(format);
  encoder->width = format.width;
  encoder->height = format.height;
  encoder->pix_fmt = encoder_format(format.format);
  encoder->time_base = {1, 1000};
  encoder->gop_size = 1;
  encoder->level = 3;
  encoder->slices = slices;
  encoder->thread_type = FF_THREAD_SLICE;
  encoder->thread_count =
      std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, slices);
  encoder->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  if (format.format == PixelFormat::yuv422p8) {
    encoder->colorspace = AVCOL_SPC_BT709;
    encoder->color_range = AVCOL_RANGE_MPEG;
    encoder->chroma_sample_location = AVCHROMA_LOC_LEFT;
  }
  av_opt_set_int(encoder->priv_data, "slicecrc", 1, 0);
  const bool deep = format.format == PixelFormat::rgb16 || format.format == PixelFormat::gray16;
  if (deep) av_opt_set(encoder->priv_data, "coder", "range_tab", 0);  // its only coder for 16 bits
  av::check(avcodec_open2(encoder.get(), codec, nullptr), file, "FFV1 cannot be started");
  return encoder;
}

av::Codec open_ffv1_decoder(const AVCodecParameters& parameters,
                            const std::filesystem::path& file) {
  const AVCodec* codec = avcodec_find_decoder(AV_CODEC_ID_FFV1);
  if (!codec) throw Error(file.string() + ": this libavcodec has no FFV1 decoder");
  av::Codec decoder(av::made(avcodec_alloc_context3(codec)));
  av::check(avcodec_parameters_to_context(decoder.get(), &parameters), file,
            "its video header is damaged");
  // Slices are independent within a picture; threads over frames would hold pictures back.
  decoder->thread_type = FF_THREAD_SLICE;
  decoder->thread_count = std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, 16);
  av::check(avcodec_open2(decoder.get(), codec, nullptr), file, "its video header is damaged");
  return decoder;
}

av::Codec open_ffv1_decoder(const StreamFormat& format, const std::filesystem::path& file) {
  const av::Codec encoder = open_ffv1_encoder(format, file);
  const std::unique_ptr<AVCodecParameters, ParametersCloser> parameters(avcodec_parameters_alloc());
  if (!parameters) throw Error(file.string() + ": no memory for a video header");
  av::check(avcodec_parameters_from_context(parameters.get(), encoder.get()), file,
            "a video header cannot be created");
  return open_ffv1_decoder(*parameters, file);
}

std::size_t most_packet_bytes(const StreamFormat& format) {
  constexpr std::size_t a_pixel = 37 * 4, padding = 16384;
  const auto pixels =
      static_cast<std::size_t>(format.width) * static_cast<std::size_t>(format.height);
  constexpr std::size_t most = std::numeric_limits<int>::max() - padding;  // of an AVPacket
  if (format.codec == VideoCodec::raw)
    return frame_bytes(format.format, format.width, format.height);
  return std::min(padding + pixels * a_pixel, most);
}

}  // namespace previz::session
