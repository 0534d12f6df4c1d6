// PNG pictures return bit for bit; the review video keeps the capture times.
#include "daemon/core/output/png.hpp"
#include "daemon/core/output/video.hpp"
#include "daemon/core/session/av.hpp"
#include "drivers/plate.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::output::picture_test {

using test::TemporaryDirectory;

Plate ramp(int width, int height, int bits, unsigned offset = 0) {
  Plate plate{width, height, bits, {}};
  const unsigned codes = 1u << bits;
  for (unsigned i = 0; i < 3u * unsigned(width) * unsigned(height); ++i)
    plate.samples.push_back(static_cast<std::uint16_t>((i * 2654435761u + offset) % codes));
  return plate;
}

TEST(Png, BothDepthsReturnBitForBit) {
  const TemporaryDirectory directory;
  for (const int bits : {8, 16}) {
    for (const auto& [width, height] : {std::pair{1, 1}, std::pair{31, 7}, std::pair{64, 48}}) {
      const Plate written = ramp(width, height, bits);
      write_png(directory / "picture.png", written);
      const Plate read = read_png(directory / "picture.png");
      EXPECT_EQ(read.width, width);
      EXPECT_EQ(read.height, height);
      EXPECT_EQ(read.bits, bits);
      EXPECT_EQ(read.samples, written.samples);
    }
  }
}

TEST(Png, DamagedAndMissingFilesAreNamed) {
  const TemporaryDirectory directory;
  const auto path = directory / "picture.png";
  EXPECT_THROW(read_png(path), Error);
  write_png(path, ramp(64, 64, 8));
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  EXPECT_THAT(test::error_of([&] { read_png(path); }), HasSubstr("picture.png"));
  std::ofstream(path) << "not a picture";
  EXPECT_THROW(read_png(path), Error);
}

TEST(Png, IncompletePictureIsRefused) {
  const TemporaryDirectory directory;
  Plate plate = ramp(4, 4, 8);
  plate.samples.pop_back();
  EXPECT_THROW(write_png(directory / "picture.png", plate), Error);
  EXPECT_FALSE(std::filesystem::exists(directory / "picture.png"));
}

struct Decoded {
  std::vector<double> times_s;
  int width = 0, height = 0;
  double mean_luma = 0;  // of the last picture, 8-bit code
};

Decoded decode(const std::filesystem::path& path) {
  Decoded decoded;
  AVFormatContext* context = nullptr;
  av::check(avformat_open_input(&context, path.c_str(), nullptr, nullptr), path, "cannot be read");
  const av::Demuxer file(context);
  EXPECT_GE(avformat_find_stream_info(context, nullptr), 0);
  const AVStream* stream = file->streams[0];
  const av::Codec codec(avcodec_alloc_context3(avcodec_find_decoder(stream->codecpar->codec_id)));
  avcodec_parameters_to_context(codec.get(), stream->codecpar);
  EXPECT_EQ(avcodec_open2(codec.get(), nullptr, nullptr), 0);
  const av::Packet packet(av_packet_alloc());
  const av::Picture frame(av_frame_alloc());
  const auto receive = [&] {
    while (avcodec_receive_frame(codec.get(), frame.get()) == 0) {
      decoded.times_s.push_back(static_cast<double>(frame->pts) * av_q2d(stream->time_base));
      decoded.width = frame->width;
      decoded.height = frame->height;
      double sum = 0;
      for (int y = 0; y < frame->height; ++y)
        for (int x = 0; x < frame->width; ++x) sum += frame->data[0][y * frame->linesize[0] + x];
      decoded.mean_luma = sum / (frame->width * frame->height);
    }
  };
  while (av_read_frame(file.get(), packet.get()) == 0) {
    avcodec_send_packet(codec.get(), packet.get());
    receive();
    av_packet_unref(packet.get());
  }
  avcodec_send_packet(codec.get(), nullptr);
  receive();
  return decoded;
}

Plate gray(int width, int height, int bits, std::uint16_t value) {
  return {width, height, bits,
          std::vector<std::uint16_t>(3 * std::size_t(width) * std::size_t(height), value)};
}

TEST(Video, EveryCodecKeepsTimesSizeAndLevel) {
  const auto codecs = review_codecs();
  ASSERT_FALSE(codecs.empty());
  // Jittered capture times, as a real camera's.
  const std::vector<std::int64_t> times{1'700'000'000'567'008'006, 1'700'000'000'605'868'939,
                                        1'700'000'000'646'198'098, 1'700'000'000'801'000'000};
  for (const VideoCodec& codec : codecs) {
    for (const auto& [width, height] : {std::pair{64, 48}, std::pair{63, 47}}) {
      const TemporaryDirectory directory;
      VideoWriter video(directory / "review", width, height, codec);
      for (const std::int64_t time : times) video.write(gray(width, height, 8, 180), time);
      EXPECT_FALSE(std::filesystem::exists(directory / ("review" + codec.extension)));
      const auto path = video.close();
      EXPECT_EQ(path, directory / ("review" + codec.extension));
      const Decoded decoded = decode(path);
      EXPECT_EQ(decoded.width, width) << codec.description;
      EXPECT_EQ(decoded.height, height) << codec.description;
      ASSERT_EQ(decoded.times_s.size(), times.size()) << codec.description;
      // Rounded once to the video's clock (1/60000 s) and, in Matroska, to its milliseconds.
      const double tolerance_s = codec.container == "matroska" ? 0.5e-3 + 1e-5 : 1.0 / 60000;
      for (std::size_t i = 0; i < times.size(); ++i)
        EXPECT_NEAR(decoded.times_s[i] - decoded.times_s[0],
                    static_cast<double>(times[i] - times[0]) * 1e-9, 2 * tolerance_s)
            << codec.description;
      // BT.709 limited range: 16 + 219 * 180 / 255 = 170.6; lossy codecs stay within 2 codes.
      EXPECT_NEAR(decoded.mean_luma, 170.6, 2.0) << codec.description;
    }
  }
}

TEST(Video, HasTheTakesRateAndTimecode) {
  const TemporaryDirectory directory;
  const VideoCodec codec = review_codecs().front();
  ASSERT_EQ(codec.container, "mp4");  // Debian's libav has two encoders for it
  const double fps = 30000.0 / 1001;
  const session::TakeClock clock{fps, session::Timecode{"01:00:59;29", fps}, 0};
  VideoWriter video(directory / "review", 64, 48, codec, clock, 33'366'667);
  for (int i = 0; i < 5; ++i) video.write(gray(64, 48, 8, 100), (i + 1) * 33'366'667LL);
  AVFormatContext* context = nullptr;
  ASSERT_EQ(avformat_open_input(&context, video.close().c_str(), nullptr, nullptr), 0);
  const av::Demuxer file(context);
  ASSERT_GE(avformat_find_stream_info(context, nullptr), 0);
  EXPECT_STREQ(av_dict_get(context->streams[0]->metadata, "timecode", nullptr, 0)->value,
               "01:01:00;02");
  EXPECT_NEAR(av_q2d(context->streams[0]->avg_frame_rate), fps, 1e-3);
}

TEST(Video, SixteenBitsAreRoundedToEight) {
  const TemporaryDirectory directory;
  const auto codec = review_codecs().front();
  VideoWriter video(directory / "review", 64, 48, codec);
  video.write(gray(64, 48, 16, 180 * 257), 0);
  EXPECT_NEAR(decode(video.close()).mean_luma, 170.6, 2.0);
}

TEST(Video, WrongSizeAndTimeGoingBackAreRefusedAndLeaveNoFile) {
  const TemporaryDirectory directory;
  const auto codec = review_codecs().front();
  {
    VideoWriter video(directory / "review", 64, 48, codec);
    video.write(gray(64, 48, 8, 10), 1000);
    EXPECT_THROW(video.write(gray(32, 48, 8, 10), 2'000'000'000), Error);
    EXPECT_THROW(video.write(gray(64, 48, 8, 10), 1000), Error);
  }
  EXPECT_TRUE(std::filesystem::is_empty(directory.path()));
}

}  // namespace previz::output::picture_test
