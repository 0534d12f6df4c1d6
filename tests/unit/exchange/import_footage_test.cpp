#include "daemon/core/session/files.hpp"
#include "daemon/tools/exchange/footage.hpp"
#include "daemon/tools/exchange/picture_header.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/import_fixture.hpp"

namespace previz::exchange::import_footage_test {

TEST(Import, NumberedPicturesComeInBitForBit) {
  const Shoot shoot;
  const ImportReport report = shoot.import();
  EXPECT_EQ(report.observer_frames, 3u);
  EXPECT_EQ(report.light_frames, 0u);
  const auto stream = shoot.open();
  ASSERT_EQ(stream->records().size(), 3u);
  for (int i = 0; i < 3; ++i) {
    const FramePtr frame = stream->read(i);
    EXPECT_EQ(frame->format, PixelFormat::rgb8);
    EXPECT_EQ(frame->bytes, frame_bytes_of(noise_picture(i, CV_8UC3, 32, 24)));
    EXPECT_EQ(frame->timestamp_ns, i * 40'000'000);
    EXPECT_EQ(frame->sequence, static_cast<std::uint64_t>(i));
    EXPECT_EQ(frame->exposure, 0.5);
  }
}

struct Kind {
  const char* extension;
  int type;
  PixelFormat format;
};

class ImportKinds : public testing::TestWithParam<Kind> {};

TEST_P(ImportKinds, KeepTheirBits) {
  const auto [extension, type, format] = GetParam();
  Shoot shoot;
  const std::string name = std::string("deep.") + extension;
  write_picture(shoot.folder() / name, noise_picture(7, type, 20, 10));
  shoot.json["observer"]["pictures"] = {name};
  const FramePtr frame = shoot.first_frame();
  EXPECT_EQ(frame->format, format);
  EXPECT_EQ(frame->bytes, frame_bytes_of(noise_picture(7, type, 20, 10)));
}

const Kind kinds[] = {
    {"png", CV_8UC1, PixelFormat::gray8},   {"png", CV_8UC3, PixelFormat::rgb8},
    {"png", CV_16UC1, PixelFormat::gray16}, {"png", CV_16UC3, PixelFormat::rgb16},
    {"tiff", CV_8UC3, PixelFormat::rgb8},   {"tiff", CV_16UC1, PixelFormat::gray16},
    {"tiff", CV_16UC3, PixelFormat::rgb16},
};
INSTANTIATE_TEST_SUITE_P(Files, ImportKinds, testing::ValuesIn(kinds));

TEST(Import, JpegIsWhatItsDecoderSays) {
  Shoot shoot("a.jpg");
  write_picture(shoot.folder() / "a.jpg", cv::Mat(16, 24, CV_8UC3, cv::Scalar(30, 90, 200)));
  const FramePtr frame = shoot.first_frame();
  // One flat block: only its mean is coded, to a step of at most 2 at OpenCV's quality 95, and
  // Y'CbCr to RGB multiplies a chroma step by at most 1.8.
  EXPECT_NEAR(frame->bytes[0], 200, 6);
  EXPECT_NEAR(frame->bytes[1], 90, 6);
  EXPECT_NEAR(frame->bytes[2], 30, 6);
}

TEST(Import, ATableOfTimesAndExposuresInAnyOrder) {
  Shoot shoot;
  for (int i = 0; i < 3; ++i)
    write_picture(shoot.folder() / "light" / numbered("b", i, ".png"),
                  noise_picture(10 + i, CV_8UC3, 16, 16));
  session::write_content(shoot.folder() / "light" / "light.csv",
                         "file,timestamp_ns,exposure,kind\r\n"
                         "b0.png,1700000000684751644,0.35,auto\r\n"
                         "b1.png,1700000000304751644,8.54492187e-05,bracket\r\n"
                         "b2.png,1700000000344751644,0.0013671875,bracket\r\n");
  shoot.json["light"] = {{"csv", "light/light.csv"}};
  EXPECT_THAT(shoot.error(), HasSubstr("light.timestamps_ns must increase; entry 2"));
  shoot.json["light"]["sort_by_time"] = true;
  EXPECT_EQ(shoot.import().light_frames, 3u);
  const auto stream = shoot.open("light");
  const int order[] = {1, 2, 0};
  const double exposure[] = {8.54492187e-05, 0.0013671875, 0.35};
  for (int i = 0; i < 3; ++i) {
    const FramePtr frame = stream->read(i);
    EXPECT_EQ(frame->bytes, frame_bytes_of(noise_picture(10 + order[i], CV_8UC3, 16, 16)));
    EXPECT_EQ(frame->exposure, exposure[i]);
    EXPECT_EQ(frame->sequence, static_cast<std::uint64_t>(i));
  }
  EXPECT_EQ(stream->records()[0].timestamp_ns, 1700000000304751644);
}

TEST(Import, ExposureOfShutterGainAndResponsivity) {
  Shoot shoot;
  Json& observer = shoot.json["observer"];
  observer.erase("exposure");
  observer["exposure_s"] = {0.01, 0.02, 0.04};
  observer["gain"] = 2;
  observer["intrinsics"] =
      Json::parse(R"({"width": 32, "height": 24, "fx": 30, "fy": 30, "cx": 16, "cy": 12})");
  observer["response"] = {{"responsivity", 3}};
  ASSERT_EQ(shoot.error(), "");
  const auto stream = shoot.open();
  for (int i = 0; i < 3; ++i) {
    const session::FrameRecord& record = stream->records()[i];
    EXPECT_EQ(record.exposure_s, 0.01 * (1 << i));
    EXPECT_EQ(record.gain, 2);
    EXPECT_EQ(record.exposure, 0.01 * (1 << i) * 2 * 3);
  }
}

TEST(Import, WildcardsSortByNumber) {
  Shoot shoot;
  for (const int i : {2, 10, 1})
    write_picture(shoot.folder() / "shots" / numbered("img", i, ".png"),
                  noise_picture(i, CV_8UC3, 16, 12));
  session::write_content(shoot.folder() / "shots" / "readme.txt", "no picture");
  for (const char* pattern : {"shots/img*.png", "shots/*.png"}) {
    shoot.json["observer"]["pictures"] = pattern;
    ASSERT_EQ(shoot.error(), "");
    const auto stream = shoot.open();
    ASSERT_EQ(stream->records().size(), 3u);
    for (const int i : {0, 1, 2})
      EXPECT_EQ(stream->read(i)->bytes,
                frame_bytes_of(noise_picture(i == 2 ? 10 : i + 1, CV_8UC3, 16, 12)));
  }
}

// "%03d" takes three digits or more, "%d" any without padding; what only looks alike is left alone.
TEST(Import, NumbersMayGrowPastTheirPadding) {
  Shoot shoot;
  for (const char* name : {"s998.png", "s999.png", "s1000.png"})
    write_picture(shoot.folder() / name, noise_picture(1, CV_8UC3, 16, 12));
  for (const char* name : {"s01.png", "s0997.png", "s.png", "s1001.png.bak", "s-5.png", "s1x.png"})
    session::write_content(shoot.folder() / name, "no picture");
  for (const char* pattern : {"s%03d.png", "s%d.png"}) {
    shoot.json["observer"]["pictures"] = pattern;
    EXPECT_EQ(shoot.import().observer_frames, 3u) << pattern;
  }
}

Bytes noise_bytes(std::size_t count, int seed) {
  cv::Mat noise = noise_picture(seed, CV_8UC1, static_cast<int>(count), 1);
  return {noise.datastart, noise.dataend};
}

TEST(Import, AVideoOfBt709KeepsItsSamples) {
  Shoot shoot;
  std::vector<Bytes> frames;
  for (int i = 0; i < 4; ++i) frames.push_back(noise_bytes(2 * 64 * 48, i));
  const VideoForm form = {.pixel_format = "yuv422p",
                          .width = 64,
                          .height = 48,
                          .fps = 50,
                          .range = AVCOL_RANGE_MPEG,
                          .matrix = AVCOL_SPC_BT709};
  shoot.film("take.mkv", form, frames, {{"timestamps_ns", "container"}, {"start_ns", 1000}});
  const ImportReport report = shoot.import();
  ASSERT_EQ(report.notes.size(), 2u);
  EXPECT_THAT(report.notes[0], HasSubstr("kept as it is"));
  const auto stream = shoot.open();
  ASSERT_EQ(stream->records().size(), 4u);
  for (int i = 0; i < 4; ++i) {
    const FramePtr frame = stream->read(i);
    EXPECT_EQ(frame->format, PixelFormat::yuv422p8);
    EXPECT_EQ(frame->bytes, frames[i]);
    EXPECT_EQ(frame->timestamp_ns, 1000 + i * 20'000'000);
  }
}

// Frame 1 is taken at start_ns + 1e9 / fps; the times of a session are below 2^63 ns = 9.22e18.
TEST(Import, TimesThatNoSessionCanHoldAreRefused) {
  for (const auto& [fps, start_ns] : {std::pair<double, std::int64_t>{1e-300, 0},
                                      {1.08e-10, 0},
                                      {2.1e-10, 4'600'000'000'000'000'000}}) {
    Shoot shoot;
    shoot.json["observer"]["fps"] = fps;
    shoot.json["observer"]["start_ns"] = start_ns;
    const std::string error = shoot.error();
    EXPECT_THAT(error, HasSubstr("0001.png: its time does not fit")) << fps;
  }
  Shoot slow;
  slow.json["observer"]["fps"] = 2.2e-10;  // frame 2 at 9.09e18
  ASSERT_EQ(slow.error(), "");
  EXPECT_EQ(slow.open()->records().at(2).timestamp_ns, std::llround(2 / 2.2e-10 * 1e9));
}

TEST(Import, AVideoOfRgbKeepsItsSamples) {
  Shoot shoot;
  const Bytes rgb = noise_bytes(3 * 32 * 16, 1);
  Bytes bgr0;
  for (std::size_t i = 0; i < rgb.size(); i += 3)
    bgr0.insert(bgr0.end(), {rgb[i + 2], rgb[i + 1], rgb[i], 0});
  shoot.film("take.mkv", {.pixel_format = "bgr0"}, {bgr0});
  const FramePtr frame = shoot.first_frame();
  EXPECT_EQ(frame->format, PixelFormat::rgb8);
  EXPECT_EQ(frame->bytes, rgb);
}

// Flat colours, so that chroma interpolation plays no part. BT.601 unless marked, as players do:
// R = 255 (y' + 1.402 pr), G = 255 (y' - 0.344136 pb - 0.714136 pr), B = 255 (y' + 1.772 pb) with
// y' = (Y - 16)/219 and p = (C - 128)/224; BT.709 likewise with 1.5748, 0.187324, 0.468124, 1.8556.
// swscale's tables are fixed point: one code of rounding on top of the half.
TEST(Import, AnyOtherVideoBecomesRgb) {
  const double y = (120 - 16) / 219.0, pb = (100 - 128) / 224.0, pr = (180 - 128) / 224.0;
  const std::array bt601{y + 1.402 * pr, y - 0.344136 * pb - 0.714136 * pr, y + 1.772 * pb};
  const std::array bt709{y + 1.5748 * pr, y - 0.187324 * pb - 0.468124 * pr, y + 1.8556 * pb};
  for (const bool is_bt709 : {false, true}) {
    Shoot shoot;
    Bytes frame(64 * 48, 120);
    frame.insert(frame.end(), 32 * 24, 100);
    frame.insert(frame.end(), 32 * 24, 180);
    VideoForm form = {.pixel_format = "yuv420p", .width = 64, .height = 48};
    if (is_bt709) {
      form.range = AVCOL_RANGE_MPEG;
      form.matrix = AVCOL_SPC_BT709;
    }
    shoot.film("take.mkv", form, {frame});
    const ImportReport report = shoot.import();
    EXPECT_THAT(report.notes.at(0), HasSubstr("converted to rgb8"));
    EXPECT_NE(testing::Value(report.notes.at(0), HasSubstr("matrix smpte170m (assumed)")),
              is_bt709);
    const FramePtr rgb = shoot.open()->read(0);
    ASSERT_EQ(rgb->format, PixelFormat::rgb8);
    for (std::size_t i = 0; i < rgb->bytes.size(); ++i)
      ASSERT_NEAR(rgb->bytes[i], 255 * (is_bt709 ? bt709 : bt601)[i % 3], 1.5);
  }
}

TEST(Import, AVideoDeeperThan8BitsKeepsItsDepth) {
  Shoot shoot;
  const Bytes samples = noise_bytes(2 * 3 * 32 * 16, 5);
  shoot.film("take.mkv", {.pixel_format = "gbrp16le"}, {samples});
  const FramePtr frame = shoot.first_frame();
  ASSERT_EQ(frame->format, PixelFormat::rgb16);
  for (std::size_t pixel = 0; pixel < 32 * 16; ++pixel)
    for (int channel = 0; channel < 3; ++channel) {
      const std::size_t plane = (channel + 2) % 3;  // planes G, B, R
      for (int byte = 0; byte < 2; ++byte)
        ASSERT_EQ(frame->bytes[6 * pixel + 2 * channel + byte],
                  samples[2 * (plane * 32 * 16 + pixel) + byte]);
    }
}

TEST(Import, AVideoWithMoreOrFewerFramesThanTimes) {
  Shoot shoot;
  shoot.film("take.mkv", {.pixel_format = "gray"}, {noise_bytes(512, 1), noise_bytes(512, 2)},
             {{"timestamps_ns", {1}}});
  EXPECT_THAT(shoot.error(), HasSubstr("frame 1: exceeds the 1 frame "));
  shoot.json["observer"]["timestamps_ns"] = {1, 2, 3};
  EXPECT_THAT(shoot.error(), HasSubstr("observer has 2 frames, and not the 3 described"));
  shoot.json["observer"]["timestamps_ns"] = {1, 2};
  EXPECT_EQ(shoot.error(), "");
}

TEST(Import, DamagedFootageIsAnError) {
  Shoot shoot;
  session::write_content(shoot.folder() / "observer" / "0001.png", "no PNG");
  EXPECT_THAT(shoot.error(), HasSubstr("0001.png: cannot be read as a picture"));
  session::write_content(shoot.folder() / "a.mp4", "no video");
  shoot.json["observer"] = {{"video", "a.mp4"}, {"fps", 25}, {"exposure", 1}};
  EXPECT_THAT(shoot.error(), HasSubstr("a.mp4: cannot be read as a video"));
}

// Formats that are not on the list are refused by what a file is, whatever it is called; a play
// list and an address of a network are not followed.
TEST(Import, FootageOfOtherFormatsIsRefused) {
  Shoot shoot("a.png");
  write_picture(shoot.folder() / "a.bmp", noise_picture(1, CV_8UC3, 16, 16));
  std::filesystem::rename(shoot.folder() / "a.bmp", shoot.folder() / "a.png");
  EXPECT_THAT(shoot.error(), HasSubstr("allowed: PNG, JPEG, TIFF"));

  shoot.film("real.mkv", {.pixel_format = "gray"}, {noise_bytes(512, 1)});
  session::write_content(shoot.folder() / "list.mkv", "ffconcat version 1.0\nfile real.mkv\n");
  session::write_content(shoot.folder() / "list.mp4",
                         "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nreal.mkv\n");
  for (const char* name : {"list.mkv", "list.mp4", "concat:real.mkv", "http://127.0.0.1:1/a.mkv"}) {
    shoot.json["observer"]["video"] = name;
    EXPECT_NE(shoot.error(), "") << name;
  }
  shoot.json["observer"]["video"] = "real.mkv";
  EXPECT_EQ(shoot.error(), "");
}

// A name with a colon is a name, and no protocol.
TEST(Import, AFileWithAColonIsRead) {
  Shoot shoot;
  shoot.film("12:A.mkv", {.pixel_format = "gray"}, {noise_bytes(512, 1)});
  EXPECT_EQ(shoot.error(), "");
}

TEST(PictureHeader, HasTheSizeOfEveryKindThatIsAllowed) {
  Shoot shoot;
  for (const char* name : {"a.png", "a.jpg", "a.tiff"}) {
    write_picture(shoot.folder() / name, noise_picture(1, CV_8UC3, 37, 21));
    const std::optional<PictureSize> size = picture_size(test::content_of(shoot.folder() / name));
    ASSERT_TRUE(size) << name;
    EXPECT_EQ(size->width, 37u) << name;
    EXPECT_EQ(size->height, 21u) << name;
  }
}

// However a file is cut or changed, its header is read within its bytes.
TEST(PictureHeader, OfDamagedFilesDoesNoHarm) {
  Shoot shoot;
  std::mt19937 random(7);
  for (const char* name : {"a.png", "a.jpg", "a.tiff"}) {
    write_picture(shoot.folder() / name, noise_picture(1, CV_8UC3, 16, 16));
    const std::string whole = test::content_of(shoot.folder() / name);
    for (std::size_t size = 0; size < whole.size(); ++size) {
      std::string part(whole, 0, size);
      EXPECT_NO_THROW(picture_size(part));
      if (size > 4) part[4 + random() % (size - 4)] = static_cast<char>(random());
      EXPECT_NO_THROW(picture_size(part));
    }
  }
}

// Of two widths, libtiff takes the first one, and others the last.
TEST(PictureHeader, OfATiffWithTwoWidthsIsNone) {
  const auto entry = [](char tag, char value) {
    return std::string{tag, 1, 3, 0, 1, 0, 0, 0, value, 0, 0, 0};
  };
  const auto tiff = [](const std::vector<std::string>& entries) {
    std::string file("II*\0\x08\0\0\0", 8);
    file += {static_cast<char>(entries.size()), 0};
    for (const std::string& e : entries) file += e;
    return file + std::string(4, '\0');
  };
  const std::string wide = entry(0, 100), narrow = entry(0, 7), high = entry(1, 9);
  const std::optional<PictureSize> size = picture_size(tiff({narrow, high}));
  ASSERT_TRUE(size);
  EXPECT_EQ(size->width, 7u);
  EXPECT_EQ(size->height, 9u);
  EXPECT_FALSE(picture_size(tiff({wide, narrow, high})));
}

// One column more than the most, without any pixels.
TEST(PictureHeader, MorePixelsThanAnybodyHasAreRefused) {
  Shoot shoot;
  const auto file = shoot.folder() / "huge.png";
  session::write_content(
      file, std::string("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x40\x01\0\0\x40\0\x08\x02\0\0\0", 29));
  EXPECT_THROW(check_picture_file(file, test::content_of(file)), Error);
}

TEST(Import, TransparencyIsAnErrorUnlessThereIsNone) {
  Shoot shoot("a.png");
  cv::Mat picture = noise_picture(1, CV_8UC4, 16, 16);
  write_picture(shoot.folder() / "a.png", picture);
  EXPECT_THAT(shoot.error(), HasSubstr("is transparent in places"));
  std::vector<cv::Mat> channels;
  cv::split(picture, channels);
  channels[3].setTo(255);
  cv::merge(channels, picture);
  write_picture(shoot.folder() / "a.png", picture);
  EXPECT_EQ(shoot.error(), "");
}

}  // namespace previz::exchange::import_footage_test
