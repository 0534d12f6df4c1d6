// What libav's lossless forms of video cost and save on pictures of a camera, and whether they come
// back bit for bit.
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <optional>
#include <string>
#include <vector>

extern "C" {
#include <libavutil/opt.h>
}

#include "drivers/av.hpp"
#include "tests/bench/camera_pictures.hpp"
#include "tests/bench/measure.hpp"

namespace previz::bench {
namespace {

struct Options {
  std::filesystem::path session = "config/demo/session";
  int frames = 4;
};

struct Form {
  std::string name, codec;
  int slices = 0;
  std::vector<std::pair<std::string, std::string>> settings = {};
};

const std::vector<Form> forms = {
    {"FFV1, as in a take", "ffv1", 16, {{"slicecrc", "1"}, {"coder", "rice"}}},
    {"FFV1, 4 slices", "ffv1", 4, {{"slicecrc", "1"}, {"coder", "rice"}}},
    {"FFV1, 24 slices", "ffv1", 24, {{"slicecrc", "1"}, {"coder", "rice"}}},
    {"FFV1, range coder", "ffv1", 16, {{"slicecrc", "1"}, {"coder", "range_tab"}}},
    {"FFV1, large context", "ffv1", 16, {{"slicecrc", "1"}, {"coder", "rice"}, {"context", "1"}}},
    {"FFV1, without slice CRC", "ffv1", 16, {{"slicecrc", "0"}, {"coder", "rice"}}},
    {"huffyuv", "huffyuv"},
    {"ffvhuff", "ffvhuff"},
    {"utvideo", "utvideo", 8},
    {"magicyuv", "magicyuv", 8},
    {"rawvideo", "rawvideo"},
};

// The layouts in which libav may be given a picture of this format, without loss.
std::vector<AVPixelFormat> layouts(PixelFormat format) {
  switch (format) {
    case PixelFormat::rgb8:
      return {AV_PIX_FMT_GBRP, AV_PIX_FMT_BGR0, AV_PIX_FMT_RGB24};
    case PixelFormat::rgb16:
      return {AV_PIX_FMT_RGB48LE, AV_PIX_FMT_GBRP16LE};
    case PixelFormat::gray8:
      return {AV_PIX_FMT_GRAY8};
    case PixelFormat::gray16:
      return {AV_PIX_FMT_GRAY16LE};
    case PixelFormat::yuv422p8:
      return {AV_PIX_FMT_YUV422P};
  }
  return {};
}

std::optional<AVPixelFormat> layout_for(const AVCodec& codec, PixelFormat format) {
  for (const AVPixelFormat layout : layouts(format)) {
    if (!codec.pix_fmts) return layouts(format).back();  // any
    for (const AVPixelFormat* known = codec.pix_fmts; *known != AV_PIX_FMT_NONE; ++known)
      if (*known == layout) return layout;
  }
  return std::nullopt;
}

int sample_bytes(PixelFormat format) {
  return format == PixelFormat::rgb16 || format == PixelFormat::gray16 ? 2 : 1;
}

// Returns where a sample of an RGB picture lies, or nothing for the other formats.
std::uint8_t* rgb_sample(const AVFrame& picture, int x, int y, int channel, int bytes) {
  const auto row = [&](int plane) {
    return picture.data[plane] + static_cast<std::ptrdiff_t>(y) * picture.linesize[plane];
  };
  constexpr int plane_of_channel[] = {2, 0, 1};  // planes are G, B, R
  switch (picture.format) {
    case AV_PIX_FMT_BGR0:
      return row(0) + 4 * x + (2 - channel);
    case AV_PIX_FMT_RGB24:
    case AV_PIX_FMT_RGB48LE:
      return row(0) + (3 * x + channel) * bytes;
    default:
      return row(plane_of_channel[channel]) + x * bytes;
  }
}

// Calls what(sample of the picture, sample of the frame, bytes) for every run of samples.
template <typename What>
void for_each_run(const AVFrame& picture, const Frame& frame, const What& what) {
  const int bytes = sample_bytes(frame.format);
  std::size_t at = 0;
  if (frame.format == PixelFormat::rgb8 || frame.format == PixelFormat::rgb16) {
    for (int y = 0; y < frame.height; ++y)
      for (int x = 0; x < frame.width; ++x)
        for (int c = 0; c < 3; ++c, at += bytes)
          what(rgb_sample(picture, x, y, c, bytes), at, bytes);
    return;
  }
  const int planes = frame.format == PixelFormat::yuv422p8 ? 3 : 1;
  for (int plane = 0; plane < planes; ++plane) {
    const int width = (plane == 0 ? frame.width : (frame.width + 1) / 2) * bytes;
    for (int y = 0; y < frame.height; ++y, at += width)
      what(picture.data[plane] + static_cast<std::ptrdiff_t>(y) * picture.linesize[plane], at,
           width);
  }
}

av::Picture picture_of(const Frame& frame, AVPixelFormat layout) {
  av::Picture picture(av_frame_alloc());
  picture->width = frame.width;
  picture->height = frame.height;
  picture->format = layout;
  av::check(av_frame_get_buffer(picture.get(), 0), "a picture", "no memory");
  for_each_run(*picture, frame, [&](std::uint8_t* to, std::size_t at, int count) {
    std::copy_n(frame.bytes.data() + at, count, to);
  });
  return picture;
}

bool is_same(const AVFrame& picture, const Frame& frame) {
  bool same = picture.width == frame.width && picture.height == frame.height;
  if (!same) return false;
  for_each_run(picture, frame, [&](const std::uint8_t* from, std::size_t at, int count) {
    same = same && std::equal(from, from + count, frame.bytes.data() + at);
  });
  return same;
}

av::Codec open_encoder(const Form& form, const AVCodec& codec, const Frame& frame,
                       AVPixelFormat layout, int threads) {
  av::Codec encoder(avcodec_alloc_context3(&codec));
  encoder->width = frame.width;
  encoder->height = frame.height;
  encoder->pix_fmt = layout;
  encoder->time_base = {1, 1000};
  encoder->gop_size = 1;
  encoder->thread_count = threads;
  encoder->thread_type = FF_THREAD_SLICE;  // threads over frames hold frames back
  encoder->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  if (form.slices > 0) encoder->slices = form.slices;
  if (form.codec == "ffv1") encoder->level = 3;
  for (const auto& [name, value] : form.settings) {
    const bool is_deep = sample_bytes(frame.format) == 2 && name == "coder";
    av_opt_set(encoder->priv_data, name.c_str(), is_deep ? "range_tab" : value.c_str(), 0);
  }
  av::check(avcodec_open2(encoder.get(), &codec, nullptr), form.name, "cannot be opened");
  return encoder;
}

bool comes_back(const AVCodecContext& encoder, const AVPacket& packet, const Frame& frame) {
  const AVCodec* codec = avcodec_find_decoder(encoder.codec_id);
  av::Codec decoder(avcodec_alloc_context3(codec));
  AVCodecParameters* parameters = avcodec_parameters_alloc();
  avcodec_parameters_from_context(parameters, &encoder);
  avcodec_parameters_to_context(decoder.get(), parameters);
  avcodec_parameters_free(&parameters);
  decoder->thread_type = FF_THREAD_SLICE;
  if (avcodec_open2(decoder.get(), codec, nullptr) < 0) return false;
  av::Picture picture(av_frame_alloc());
  return avcodec_send_packet(decoder.get(), &packet) >= 0 &&
         avcodec_receive_frame(decoder.get(), picture.get()) >= 0 && is_same(*picture, frame);
}

struct Speed {
  double wall_s = 0, cpu_s = 0, bytes = 0;  // of all frames
  bool is_exact = true;
};

Speed encode(const Form& form, const AVCodec& codec, AVPixelFormat layout,
             const std::vector<FramePtr>& frames, int threads) {
  Speed speed;
  const av::Codec encoder = open_encoder(form, codec, *frames.front(), layout, threads);
  const av::Packet packet(av_packet_alloc());
  std::int64_t time = 0;
  for (const FramePtr& frame : frames) {
    const av::Picture picture = picture_of(*frame, layout);
    picture->pts = time++;
    const auto begin = std::chrono::steady_clock::now();
    const double cpu = cpu_seconds();
    av::check(avcodec_send_frame(encoder.get(), picture.get()), form.name, "failed");
    av::check(avcodec_receive_packet(encoder.get(), packet.get()), form.name, "failed");
    speed.cpu_s += cpu_seconds() - cpu;
    speed.wall_s += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    speed.bytes += packet->size;
    speed.is_exact = speed.is_exact && comes_back(*encoder, *packet, *frame);
    av_packet_unref(packet.get());
  }
  return speed;
}

void measure(const Form& form, const std::vector<FramePtr>& frames) {
  const AVCodec* codec = avcodec_find_encoder_by_name(form.codec.c_str());
  if (!codec) return static_cast<void>(std::printf("| | %s | no encoder |\n", form.name.c_str()));
  const Frame& first = *frames.front();
  const std::optional<AVPixelFormat> layout = layout_for(*codec, first.format);
  if (!layout)
    return static_cast<void>(std::printf("| | %s | not possible | | | | |\n", form.name.c_str()));
  const Speed one = encode(form, *codec, *layout, frames, 1);
  const Speed all = encode(form, *codec, *layout, frames, 0);
  const double count = static_cast<double>(frames.size());
  const double raw = count * static_cast<double>(first.bytes.size());
  std::printf("| | %s | %.0f, %.1f | %.0f, %.1f | %.1f | %.2f | %s |\n", form.name.c_str(),
              1e-6 * raw / one.cpu_s, count / one.cpu_s, 1e-6 * raw / all.wall_s,
              count / all.wall_s, 1e3 * all.cpu_s / count, one.bytes / raw,
              one.is_exact && all.is_exact ? "yes" : "NO");
  std::fflush(stdout);
}

void run(const Options& options) {
  std::printf(
      "| pictures | form | one thread: MB/s, frames/s (CPU) | all threads (clock) | CPU ms "
      "per frame | size | exact |\n| --- | --- | --- | --- | --- | --- | --- |\n");
  constexpr PixelFormat formats[] = {PixelFormat::rgb8, PixelFormat::yuv422p8, PixelFormat::gray8,
                                     PixelFormat::gray16, PixelFormat::rgb16};
  for (const auto& [width, height] : {std::pair{1920, 1080}, std::pair{3840, 2160}})
    for (const PixelFormat format : formats) {
      const auto frames = camera_pictures(options.session, format, width, height, options.frames);
      std::printf("| %s %dx%d, %.1f MB | | | | | | |\n", to_string(format), width, height,
                  1e-6 * static_cast<double>(frames.front()->bytes.size()));
      for (const Form& form : forms) measure(form, frames);
    }
}

}  // namespace
}  // namespace previz::bench

int main(int argc, char** argv) {
  previz::bench::Options options;
  CLI::App app("Speed and size of lossless forms of video");
  app.add_option("--session", options.session, "The session whose pictures are enlarged");
  app.add_option("--frames", options.frames, "Frames of each size and format");
  CLI11_PARSE(app, argc, argv);
  av_log_set_level(AV_LOG_FATAL);
  try {
    previz::bench::run(options);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "bench_codecs: %s\n", error.what());
    return 1;
  }
}
