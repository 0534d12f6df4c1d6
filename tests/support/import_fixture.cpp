#include "tests/support/import_fixture.hpp"

#include <gtest/gtest.h>

extern "C" {
#include <libavutil/imgutils.h>
#include <libavutil/pixdesc.h>
}

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "drivers/av.hpp"

namespace previz::exchange {

std::string numbered(const std::string& before, int number, const std::string& after) {
  return before + std::to_string(number) + after;
}

cv::Mat noise_picture(int seed, int type, int width, int height) {
  cv::Mat picture(height, width, type);
  cv::RNG(seed + 1).fill(picture, cv::RNG::UNIFORM, 0, picture.depth() == CV_16U ? 65536 : 256);
  return picture;
}

std::vector<std::uint8_t> frame_bytes_of(const cv::Mat& picture) {
  cv::Mat rgb = picture;
  if (picture.channels() == 3) cv::cvtColor(picture, rgb, cv::COLOR_BGR2RGB);
  return {rgb.datastart, rgb.dataend};
}

void write_picture(const std::filesystem::path& file, const cv::Mat& picture) {
  std::filesystem::create_directories(file.parent_path());
  ASSERT_TRUE(cv::imwrite(file.string(), picture));
}

void write_video(const std::filesystem::path& file, const std::string& pixel_format,
                 const std::vector<std::vector<std::uint8_t>>& frames, int width, int height,
                 int fps, bool bt709) {
  AVFormatContext* context = nullptr;
  ASSERT_GE(avformat_alloc_output_context2(&context, nullptr, nullptr, file.c_str()), 0);
  const av::Muxer muxer(context);
  const AVCodec* codec = avcodec_find_encoder(AV_CODEC_ID_FFV1);
  const av::Codec encoder(avcodec_alloc_context3(codec));
  encoder->width = width;
  encoder->height = height;
  encoder->pix_fmt = av_get_pix_fmt(pixel_format.c_str());
  encoder->time_base = {1, fps};
  encoder->thread_count = 1;
  encoder->flags |= AV_CODEC_FLAG_GLOBAL_HEADER;
  if (bt709) {
    encoder->colorspace = AVCOL_SPC_BT709;
    encoder->color_range = AVCOL_RANGE_MPEG;
  }
  ASSERT_EQ(avcodec_open2(encoder.get(), codec, nullptr), 0);
  AVStream* stream = avformat_new_stream(context, nullptr);
  avcodec_parameters_from_context(stream->codecpar, encoder.get());
  stream->time_base = encoder->time_base;
  ASSERT_GE(avio_open(&muxer->pb, file.c_str(), AVIO_FLAG_WRITE), 0);
  ASSERT_GE(avformat_write_header(context, nullptr), 0);
  const av::Packet packet(av_packet_alloc());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const av::Picture picture(av_frame_alloc());
    picture->width = width;
    picture->height = height;
    picture->format = encoder->pix_fmt;
    av_frame_get_buffer(picture.get(), 0);
    const std::uint8_t* planes[4];
    int strides[4];
    av_image_fill_arrays(const_cast<std::uint8_t**>(planes), strides, frames[i].data(),
                         encoder->pix_fmt, width, height, 1);
    av_image_copy(picture->data, picture->linesize, planes, strides, encoder->pix_fmt, width,
                  height);
    picture->pts = static_cast<std::int64_t>(i);
    ASSERT_EQ(avcodec_send_frame(encoder.get(), picture.get()), 0);
    ASSERT_EQ(avcodec_receive_packet(encoder.get(), packet.get()), 0);
    av_packet_rescale_ts(packet.get(), encoder->time_base, stream->time_base);
    ASSERT_GE(av_write_frame(context, packet.get()), 0);
    av_packet_unref(packet.get());
  }
  ASSERT_EQ(av_write_trailer(context), 0);
}

Shoot::Shoot() {
  for (int i = 0; i < 3; ++i)
    write_picture(folder() / "observer" / numbered("000", i, ".png"),
                  noise_picture(i, CV_8UC3, 32, 24));
  json = {{"observer", {{"pictures", "observer/%04d.png"}, {"fps", 25}, {"exposure", 0.5}}}};
}

ImportReport Shoot::import() const {
  const std::filesystem::path file = folder() / "FRAMES.json";
  session::write_content(file, json.dump(1));
  return import_session({file, session()});
}

std::string Shoot::error() const {
  try {
    import();
    return "";
  } catch (const Error& error) {
    EXPECT_FALSE(std::filesystem::exists(session()));
    for (const auto& entry : std::filesystem::directory_iterator(folder()))
      EXPECT_FALSE(entry.path().filename().string().starts_with(".")) << entry.path();
    return error.what();
  }
}

}  // namespace previz::exchange
