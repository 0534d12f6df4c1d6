#include "tests/support/import_fixture.hpp"

extern "C" {
#include <libavutil/imgutils.h>
#include <libavutil/pixdesc.h>
}

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "daemon/core/session/av.hpp"

namespace previz::exchange {

std::string numbered(const std::string& before, int number, const std::string& after) {
  return before + std::to_string(number) + after;
}

cv::Mat noise_picture(int seed, int type, int width, int height) {
  cv::Mat picture(height, width, type);
  cv::RNG(seed + 1).fill(picture, cv::RNG::UNIFORM, 0, picture.depth() == CV_16U ? 65536 : 256);
  return picture;
}

Bytes frame_bytes_of(const cv::Mat& picture) {
  cv::Mat rgb = picture;
  if (picture.channels() == 3) cv::cvtColor(picture, rgb, cv::COLOR_BGR2RGB);
  return {rgb.datastart, rgb.dataend};
}

void write_picture(const std::filesystem::path& file, const cv::Mat& picture) {
  std::filesystem::create_directories(file.parent_path());
  ASSERT_TRUE(cv::imwrite(file.string(), picture));
}

namespace {

av::Codec open_encoder(const VideoForm& form, const AVOutputFormat& container) {
  const AVCodec* codec = avcodec_find_encoder_by_name(form.encoder.c_str());
  if (!codec) throw Error("libav has no encoder " + form.encoder);
  av::Codec encoder(avcodec_alloc_context3(codec));
  encoder->width = form.width;
  encoder->height = form.height;
  encoder->pix_fmt = av_get_pix_fmt(form.pixel_format.c_str());
  encoder->time_base = {form.seconds, form.fps};
  encoder->framerate = {form.fps, form.seconds};
  encoder->thread_count = 1;
  // A bare stream has its head before the frames.
  if (!(container.flags & AVFMT_NOTIMESTAMPS)) encoder->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  encoder->strict_std_compliance = FF_COMPLIANCE_EXPERIMENTAL;
  encoder->color_range = form.range;
  encoder->colorspace = form.matrix;
  encoder->color_trc = form.transfer;
  encoder->color_primaries = form.primaries;
  encoder->sample_aspect_ratio = form.pixel_aspect;
  AVDictionary* options = nullptr;
  for (const auto& [name, value] : form.options)
    av_dict_set(&options, name.c_str(), value.c_str(), 0);
  const int opened = avcodec_open2(encoder.get(), codec, &options);
  EXPECT_EQ(av_dict_count(options), 0) << "unknown options of " << form.encoder;
  av_dict_free(&options);
  av::check(opened, form.encoder, "cannot be opened");
  return encoder;
}

std::uint8_t* new_side_data(AVStream& stream, AVPacketSideDataType type, std::size_t bytes) {
#if LIBAVCODEC_VERSION_INT >= AV_VERSION_INT(60, 31, 100)
  AVCodecParameters& of = *stream.codecpar;
  return av_packet_side_data_new(&of.coded_side_data, &of.nb_coded_side_data, type, bytes, 0)->data;
#else
  return av_stream_new_side_data(&stream, type, bytes);
#endif
}

AVStream& add_stream(AVFormatContext& context, const AVCodecContext& encoder,
                     const VideoForm& form) {
  AVStream* stream = avformat_new_stream(&context, nullptr);
  avcodec_parameters_from_context(stream->codecpar, &encoder);
  if (form.container) form.container(*stream->codecpar);
  stream->time_base = encoder.time_base;
  stream->avg_frame_rate = encoder.framerate;
  stream->sample_aspect_ratio = form.pixel_aspect;
  for (const auto& [name, value] : form.metadata)
    av_dict_set(&stream->metadata, name.c_str(), value.c_str(), 0);
  const std::size_t bytes = form.display_matrix.size() * sizeof(std::int32_t);
  if (bytes > 0)
    std::memcpy(new_side_data(*stream, AV_PKT_DATA_DISPLAYMATRIX, bytes),
                form.display_matrix.data(), bytes);
  return *stream;
}

av::Picture picture_of(const Bytes& bytes, const AVCodecContext& encoder) {
  av::Picture picture(av_frame_alloc());
  picture->width = encoder.width;
  picture->height = encoder.height;
  picture->format = encoder.pix_fmt;
  av_frame_get_buffer(picture.get(), 0);
  const std::uint8_t* planes[4];
  int strides[4];
  av_image_fill_arrays(const_cast<std::uint8_t**>(planes), strides, bytes.data(), encoder.pix_fmt,
                       encoder.width, encoder.height, 1);
  av_image_copy(picture->data, picture->linesize, planes, strides, encoder.pix_fmt, encoder.width,
                encoder.height);
  return picture;
}

}  // namespace

void write_video(const std::filesystem::path& file, const VideoForm& form,
                 const std::vector<Bytes>& frames) {
  av_log_set_level(AV_LOG_ERROR);  // encoders talk
  AVFormatContext* context = nullptr;
  ASSERT_GE(avformat_alloc_output_context2(&context, nullptr, nullptr, file.c_str()), 0);
  const av::Muxer muxer(context);
  const av::Codec encoder = open_encoder(form, *context->oformat);
  AVStream& stream = add_stream(*context, *encoder, form);
  ASSERT_GE(avio_open(&muxer->pb, file.c_str(), AVIO_FLAG_WRITE), 0);
  ASSERT_GE(avformat_write_header(context, nullptr), 0);
  const av::Packet packet(av_packet_alloc());
  int written = 0;
  const auto write = [&] {
    while (avcodec_receive_packet(encoder.get(), packet.get()) == 0) {
      av_packet_rescale_ts(packet.get(), encoder->time_base, stream.time_base);
      const bool stays = !form.spoil || form.spoil(*packet, written);
      if (stays) {
        ASSERT_GE(av_write_frame(context, packet.get()), 0);
      }
      ++written;
      av_packet_unref(packet.get());
    }
  };
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const av::Picture picture = picture_of(frames[i], *encoder);
    picture->pts = form.times.empty() ? static_cast<std::int64_t>(i) : form.times[i];
    ASSERT_EQ(avcodec_send_frame(encoder.get(), picture.get()), 0);
    write();
  }
  ASSERT_EQ(avcodec_send_frame(encoder.get(), nullptr), 0);
  write();
  ASSERT_EQ(av_write_trailer(context), 0);
}

Shoot::Shoot() {
  for (int i = 0; i < 3; ++i)
    write_picture(folder() / "observer" / numbered("000", i, ".png"),
                  noise_picture(i, CV_8UC3, 32, 24));
  json = {{"observer", {{"pictures", "observer/%04d.png"}, {"fps", 25}, {"exposure", 0.5}}}};
}

Shoot::Shoot(const std::string& picture) : Shoot() {
  json["observer"]["pictures"] = {picture};
}

void Shoot::film(const std::string& name, const VideoForm& form, const std::vector<Bytes>& frames,
                 const Json& more) {
  write_video(folder() / name, form, frames);
  json["observer"] = {{"video", name}, {"exposure", 1}};
  json["observer"].update(more);
}

ImportReport Shoot::import() const {
  const std::filesystem::path file = folder() / "FRAMES.json";
  session::write_content(file, json.dump(1));
  std::filesystem::remove_all(session());
  return import_session({file, session()});
}

std::string Shoot::error() const {
  std::string message = test::error_of([&] { import(); });
  if (message.empty()) return "";
  EXPECT_FALSE(std::filesystem::exists(session()));
  for (const auto& entry : std::filesystem::directory_iterator(folder()))
    EXPECT_FALSE(entry.path().filename().string().starts_with(".")) << entry.path();
  return message;
}

FramePtr Shoot::first_frame() const {
  import();
  return open()->read(0);
}

std::unique_ptr<session::StreamReader> Shoot::open(const std::string& source) const {
  session::Session opened = session::open_session(session());
  auto stream = session::open_stream(opened, source);
  EXPECT_TRUE(opened.missing.empty());
  return stream;
}

}  // namespace previz::exchange
