// Numbered pictures: how their names are written, and what is missing of them.
#include "daemon/tools/exchange/picture_sequence.hpp"

#include "daemon/core/session/files.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/import_fixture.hpp"

namespace previz::exchange::picture_sequence_test {

// A folder of empty files.
class Folder {
 public:
  explicit Folder(const std::vector<std::string>& names) {
    for (const std::string& name : names) session::write_content(directory_.path() / name, "");
  }
  PictureSequence find(const std::string& pattern) const {
    return picture_sequence(directory_.path() / pattern);
  }
  std::vector<std::string> names(const std::string& pattern) const {
    std::vector<std::string> names;
    for (const auto& file : find(pattern).files) names.push_back(file.filename().string());
    return names;
  }
  std::string error(const std::string& pattern) const {
    return test::error_of([&] { find(pattern); });
  }

 private:
  test::TemporaryDirectory directory_;
};

const Folder with_holes({"plate.1001.png", "plate.1002.png", "plate.1005.png", "plate.txt"});

TEST(PictureSequence, AHoleIsLostFramesHoweverThePatternIsWritten) {
  for (const char* pattern :
       {"plate.%04d.png", "plate.%d.png", "plate.####.png", "plate.#.png", "plate.@@@@.png",
        "plate.@.png", "plate.$F4.png", "plate.$F.png", "plate.*.png", "plate.????.png",
        "plate.%04d.png 1001-1005", "plate.1001-1005####.png", "plate.[1001-1005].png",
        "plate.{1001..1005}.png"}) {
    const PictureSequence found = with_holes.find(pattern);
    EXPECT_EQ(found.files.size(), 3u) << pattern;
    EXPECT_THAT(found.positions, ElementsAre(0, 1, 4)) << pattern;
    EXPECT_EQ(found.missing, 2u) << pattern;
    EXPECT_THAT(found.words, HasSubstr("1003, 1004 are missing: 2 frames are lost")) << pattern;
  }
}

TEST(PictureSequence, OfARangeMissesWhatIsNotThere) {
  const PictureSequence found = with_holes.find("plate.%04d.png 1000-1002");
  EXPECT_THAT(found.positions, ElementsAre(1, 2));
  EXPECT_EQ(found.missing, 1u);
  EXPECT_THAT(found.words, HasSubstr("1000 is missing: 1 frame is lost"));
  const PictureSequence longer = with_holes.find("plate.1005-1010@@@@.png");
  EXPECT_THAT(longer.positions, ElementsAre(0));
  EXPECT_THAT(longer.words, HasSubstr("1006 to 1010 are missing: 5 frames are lost"));
  EXPECT_THAT(with_holes.error("plate.%04d.png 1-9"), HasSubstr("file not found"));
}

TEST(PictureSequence, GrowsPastItsPadding) {
  const Folder folder({"f_996.png", "f_999.png", "f_1000.png", "f_1001.png"});
  for (const char* pattern : {"f_%04d.png", "f_%03d.png", "f_####.png", "f_*.png", "f_%d.png"}) {
    EXPECT_THAT(folder.names(pattern),
                ElementsAre("f_996.png", "f_999.png", "f_1000.png", "f_1001.png"))
        << pattern;
    EXPECT_EQ(folder.find(pattern).missing, 2u) << pattern;
  }
}

TEST(PictureSequence, ANameWithTheseLettersIsAFile) {
  const Folder folder(
      {"take#1.png", "take2.png", "50%.png", "a@b_0001.png", "a@b_0002.png", "cam1-20003.png"});
  for (const char* pattern : {"a@b_%04d.png", "a@b_*.png"})
    EXPECT_THAT(folder.names(pattern), ElementsAre("a@b_0001.png", "a@b_0002.png")) << pattern;
  EXPECT_THAT(folder.names("cam1-2%04d.png"), ElementsAre("cam1-20003.png"));
  EXPECT_THAT(folder.names("take#1.png"), ElementsAre("take#1.png"));
  EXPECT_THAT(folder.names("50%.png"), ElementsAre("50%.png"));
  EXPECT_THAT(folder.names("take#.png"), ElementsAre("take2.png"));
}

TEST(PictureSequence, ANumberThatIsThereTwiceIsRefused) {
  const Folder folder({"a1.png", "a01.png", "a2.png"});
  const Folder padded({"a1.png", "a0001.png", "a0002.png"});
  EXPECT_THAT(padded.names("a%04d.png"), ElementsAre("a0001.png", "a0002.png"));
  EXPECT_THAT(folder.error("a*.png"),
              HasSubstr("the number 1 is there twice, a01.png and a1.png; remove one"));
}

// Names that differ in more than a number, or hold times, have no number of a frame.
TEST(PictureSequence, OfOtherNamesIsInTheirOrder) {
  const Folder cameras({"a1.png", "b7.png", "b30.png"});
  EXPECT_THAT(cameras.find("*.png").positions, ElementsAre(0, 1, 2));
  EXPECT_EQ(cameras.find("*.png").words, "");
  const Folder seconds({"t_20261129114510.png", "t_20261129114520.png"});
  EXPECT_THAT(seconds.find("*.png").positions, ElementsAre(0, 1));
  const Folder times({"1700000000304751644.png", "1700000000344751644.png"});
  const PictureSequence found = times.find("*.png");
  EXPECT_THAT(found.positions, ElementsAre(0, 1));
  EXPECT_EQ(found.missing, 0u);
  EXPECT_THAT(found.words, HasSubstr("do not count frames"));
}

// Frame 1003 of a sequence from 1001 on at 25 frames per second is taken at 80 ms.
TEST(Import, ASequenceWithAHoleKeepsItsTimes) {
  Shoot shoot;
  for (const int i : {1001, 1002, 1005})
    write_picture(shoot.folder() / numbered("plate.", i, ".png"),
                  noise_picture(i, CV_8UC3, 16, 12));
  for (const char* pattern : {"plate.%04d.png", "plate.*.png", "plate.####.png"}) {
    shoot.json["observer"]["pictures"] = pattern;
    EXPECT_THAT(shoot.import().notes, Contains(HasSubstr("1003, 1004 are missing")));
    const auto stream = shoot.open();
    ASSERT_EQ(stream->records().size(), 3u);
    for (const auto& [i, ms] : {std::pair{0, 0}, {1, 40}, {2, 160}})
      EXPECT_EQ(stream->records()[i].timestamp_ns, ms * 1'000'000) << pattern;
    EXPECT_EQ(stream->read(2)->bytes, frame_bytes_of(noise_picture(1005, CV_8UC3, 16, 12)));
  }
  // Lists count the missing ones, too, and times that are given stand for themselves.
  shoot.json["observer"]["exposure"] = {1, 2, 3};
  EXPECT_THAT(shoot.error(), AllOf(HasSubstr("observer.exposure has 3 entries; there are 5 frames"),
                                   HasSubstr("1003, 1004 are missing")));
  shoot.json["observer"]["exposure"] = {1, 2, 3, 4, 5};
  EXPECT_EQ(shoot.error(), "");
  EXPECT_EQ(shoot.open()->records()[2].exposure, 5);
  shoot.json["observer"].erase("fps");
  shoot.json["observer"]["timestamps_ns"] = {10, 20, 30};
  shoot.json["observer"]["exposure"] = 1;
  EXPECT_EQ(shoot.error(), "");
  EXPECT_EQ(shoot.open()->records()[2].timestamp_ns, 30);
}

// 10 bits, as scanners and recorders write it; the codes of its 1023 become those of 65535.
TEST(Import, ADpxSequenceIsRead) {
  Shoot shoot;
  for (int i = 0; i < 2; ++i) {
    Bytes planes;  // green, blue, red
    for (const int code : {400, 200, 800 + i})
      for (int pixel = 0; pixel < 32 * 16; ++pixel)
        planes.insert(planes.end(),
                      {static_cast<std::uint8_t>(code), static_cast<std::uint8_t>(code >> 8)});
    write_video(shoot.folder() / numbered("a", i, ".dpx"),
                {.pixel_format = "gbrp10le", .encoder = "dpx"}, {planes});
  }
  shoot.json["observer"]["pictures"] = "a%d.dpx";
  const ImportReport report = shoot.import();
  EXPECT_THAT(report.notes, Contains(HasSubstr("which calls every DPX linear")));
  const auto stream = shoot.open();
  ASSERT_EQ(stream->records().size(), 2u);
  const FramePtr frame = stream->read(1);
  ASSERT_EQ(frame->format, PixelFormat::rgb16);
  const auto* samples = reinterpret_cast<const std::uint16_t*>(frame->bytes.data());
  for (const auto& [c, code] : {std::pair{0, 801}, {1, 400}, {2, 200}})
    EXPECT_NEAR(samples[c], 65535 * code / 1023.0, 64) << c;  // 1023 and 1024 steps in 16 bits

  // Byte 801 is the transfer characteristic: film's density is refused, and linear is heeded where
  // another program says it.
  const auto file = shoot.folder() / "a1.dpx";
  std::string content = test::content_of(file);
  content[801] = 1;
  session::write_content(file, content);
  shoot.json["observer"]["pictures"] = {"a1.dpx"};
  EXPECT_THAT(shoot.error(), HasSubstr("a1.dpx: is logarithmic, as film is scanned"));
  content[801] = 2;
  content[160] = 'X';
  session::write_content(file, content);
  const FramePtr linear = shoot.first_frame();
  EXPECT_NEAR(reinterpret_cast<const std::uint16_t*>(linear->bytes.data())[1] / 65535.0,
              1.055 * std::pow(400 / 1023.0, 1 / 2.4) - 0.055, 0.001);  // the same
}

}  // namespace previz::exchange::picture_sequence_test
