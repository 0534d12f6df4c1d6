// Videos whose times begin again, because recordings were appended, or that have none.
#include "tests/support/import_fixture.hpp"

namespace previz::exchange::import_joined_test {

constexpr int in_part = 12;

// Grey frames, each a step lighter than the one before; the first has that number. Noise in the
// lower part makes them as large as those of cameras.
std::vector<Bytes> numbered_frames(int first, int count) {
  std::vector<Bytes> frames;
  for (int i = 0; i < count; ++i) {
    Bytes bytes(128 * 96, static_cast<std::uint8_t>(20 + 5 * (first + i)));
    const Bytes noise = frame_bytes_of(noise_picture(first + i, CV_8UC1, 128, 32));
    std::ranges::copy(noise, bytes.end() - 128 * 32);
    bytes.resize(128 * 96 * 3 / 2, 128);
    frames.push_back(std::move(bytes));
  }
  return frames;
}

// The number of a frame by its grey: limited range, 5 codes a step.
int number_of(const Frame& frame) {
  const double luma = 16 + frame.bytes[frame.bytes.size() / 2] * 219.0 / 255;
  return static_cast<int>(std::lround((luma - 20) / 5));
}

struct StreamForm {
  const char *name, *encoder, *ending;
  std::map<std::string, std::string> options{};
};

std::ostream& operator<<(std::ostream& out, const StreamForm& stream) {
  return out << stream.name;
}

VideoForm form_of(const StreamForm& stream) {
  return {.pixel_format = "yuv420p",
          .width = 128,
          .height = 96,
          .encoder = stream.encoder,
          .options = stream.options};
}

void film_part(const Shoot& shoot, const std::string& name, int first, const VideoForm& form) {
  write_video(shoot.folder() / name, form, numbered_frames(first, in_part));
}

// Writes so many recordings, and appends them as `cat` does.
void film_parts(Shoot& shoot, const StreamForm& stream, int parts, const Json& more) {
  std::string joined;
  for (int part = 0; part < parts; ++part) {
    const std::string name = std::string("part") + stream.ending;
    film_part(shoot, name, part * in_part, form_of(stream));
    joined += session::content_of(shoot.folder() / name);
  }
  const std::string name = std::string("take") + stream.ending;
  session::write_content(shoot.folder() / name, joined);
  shoot.json["observer"] = {{"video", name}, {"exposure", 1}};
  shoot.json["observer"].update(more);
}

void expect_all_frames(const Shoot& shoot, int count) {
  const auto frames = shoot.open();
  ASSERT_EQ(frames->records().size(), static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) {
    const FramePtr frame = frames->read(static_cast<std::size_t>(i));
    EXPECT_EQ(number_of(*frame), i);
    EXPECT_NEAR(static_cast<double>(frame->timestamp_ns), i * 40e6, 1e5) << i;
  }
}

const Json its_own_times = Json::object();
const Json a_rate = {{"fps", 25}};

const std::map<std::string, std::string> plain_h264 = {{"bf", "0"}, {"g", "6"}, {"qp", "10"}},
                                         b_h264 = {{"bf", "2"}, {"g", "6"}, {"qp", "10"}};
const StreamForm streams[] = {
    {"h264_ts", "libx264", ".ts", plain_h264},
    {"h264_b_ts", "libx264", ".ts", b_h264},
    {"h264_b_m2ts", "libx264", ".m2ts", b_h264},
    {"hevc_ts",
     "libx265",
     ".ts",
     {{"x265-params", "log-level=none:pools=none:bframes=2:keyint=6:qp=10"}}},
    {"mpeg2_ts", "mpeg2video", ".ts", {{"bf", "2"}, {"g", "6"}, {"b", "9000000"}}},
    {"mpeg2_mpg", "mpeg2video", ".mpg", {{"bf", "2"}, {"g", "6"}, {"b", "9000000"}}},
};

class ImportJoinedVideo : public testing::TestWithParam<StreamForm> {};

TEST_P(ImportJoinedVideo, ComesInWholeAndItsTimesContinue) {
  for (const Json& times : {its_own_times, a_rate}) {
    for (const int parts : {2, 3}) {
      Shoot shoot;
      film_parts(shoot, GetParam(), parts, times);
      const ImportReport report = shoot.import();
      expect_all_frames(shoot, parts * in_part);
      EXPECT_THAT(
          report.notes,
          Contains(HasSubstr(parts == 2 ? "times begin again at frame 12: recordings"
                                        : "times begin again at frame 12, 24: recordings")));
      EXPECT_THAT(report.notes, Not(Contains(HasSubstr("lost"))));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Streams, ImportJoinedVideo, testing::ValuesIn(streams),
                         [](const auto& stream) { return std::string(stream.param.name); });

// The second recording begins long before the first: libav takes its times for those of a clock
// that ran over after 26 hours.
TEST(ImportVideo, ARecordingOfEarlierTimesThatWasAppendedContinues) {
  const StreamForm stream = streams[0];
  Shoot shoot;
  std::string joined;
  for (const int part : {0, 1}) {
    VideoForm form = form_of(stream);
    for (int i = 0; i < in_part; ++i) form.times.push_back(i + (part == 0 ? 25 * 600 : 0));
    film_part(shoot, "part.ts", part * in_part, form);
    joined += session::content_of(shoot.folder() / "part.ts");
  }
  session::write_content(shoot.folder() / "take.ts", joined);
  shoot.json["observer"] = {{"video", "take.ts"}, {"exposure", 1}};
  ASSERT_EQ(shoot.error(), "");
  expect_all_frames(shoot, 2 * in_part);
}

// A frame that is lost in one part counts once, though frames of the others have its time.
TEST(ImportVideo, AFrameThatIsLostInOnePartTakesNoneOfAnother) {
  const StreamForm stream = streams[0];
  Shoot shoot;
  std::string joined;
  for (int part = 0; part < 3; ++part) {
    VideoForm form = form_of(stream);
    if (part == 1)
      form.spoil = [](AVPacket& packet, int number) {
        if (number == in_part - 1)
          std::fill(packet.data + 5, packet.data + packet.size, std::uint8_t{0});
        return true;
      };
    film_part(shoot, "part.ts", part * in_part, form);
    joined += session::content_of(shoot.folder() / "part.ts");
  }
  session::write_content(shoot.folder() / "take.ts", joined);
  shoot.json["observer"] = {{"video", "take.ts"}, {"exposure", 1}};
  EXPECT_THAT(shoot.import().notes, Contains(HasSubstr(": 1 frame is lost")));
  const auto frames = shoot.open();
  ASSERT_EQ(frames->records().size(), std::size_t{3 * in_part - 1});
  for (std::size_t i = 0; i < frames->records().size(); ++i) {
    const auto number = static_cast<int>(i) + (i >= 2 * in_part - 1 ? 1 : 0);
    const FramePtr frame = frames->read(i);
    EXPECT_EQ(number_of(*frame), number);
    EXPECT_EQ(frame->sequence, static_cast<std::uint64_t>(number));
    EXPECT_NEAR(static_cast<double>(frame->timestamp_ns), number * 40e6, 1e5);
  }
}

// ------------------------------------------------------------ no times

const StreamForm bare[] = {
    {"h264", "libx264", ".h264", plain_h264},
    {"h264_b", "libx264", ".h264", b_h264},
    {"hevc", "libx265", ".hevc", {{"x265-params", "log-level=none:pools=none:bframes=2:qp=10"}}}};

class ImportBareVideo : public testing::TestWithParam<StreamForm> {};

TEST_P(ImportBareVideo, ComesInByTheRateThatIsGiven) {
  const StreamForm& stream = GetParam();
  Shoot shoot;
  VideoForm form = form_of(stream);
  const std::string name = std::string("take") + stream.ending;
  shoot.film(name, form, numbered_frames(0, in_part), its_own_times);
  EXPECT_THAT(shoot.error(),
              AllOf(HasSubstr(name + " frame 0: has no time stamp"), HasSubstr("give \"fps\"")));
  shoot.json["observer"]["fps"] = 25;
  ASSERT_EQ(shoot.error(), "");
  expect_all_frames(shoot, in_part);
}

INSTANTIATE_TEST_SUITE_P(Streams, ImportBareVideo, testing::ValuesIn(bare),
                         [](const auto& stream) { return std::string(stream.param.name); });

TEST(ImportVideo, ABareStreamThatIsDamagedIsRefused) {
  const StreamForm stream = bare[0];
  Shoot shoot;
  VideoForm form = form_of(stream);
  form.options["sc_threshold"] = "0";  // no further key frames, before which nothing can be missed
  form.spoil = [](AVPacket&, int number) { return number != 4; };
  shoot.film("take.h264", form, numbered_frames(0, in_part), a_rate);
  EXPECT_THAT(shoot.error(), AllOf(HasSubstr("without times, and is damaged after "),
                                   HasSubstr("container that has times")));
}

TEST(ImportVideo, AnAVIFileWithoutAllTimesAsksForTheRate) {
  for (const char* encoder : {"libx264", "mpeg4"}) {
    const StreamForm stream{"", encoder, ".avi", {{"bf", "2"}, {"g", "6"}}};
    Shoot shoot;
    shoot.film("take.avi", form_of(stream), numbered_frames(0, in_part), its_own_times);
    EXPECT_THAT(shoot.error(), HasSubstr("give \"fps\""));
    shoot.json["observer"]["fps"] = 25;
    ASSERT_EQ(shoot.error(), "");
    EXPECT_EQ(shoot.open()->records().size(), std::size_t{in_part});
  }
}

// A camera that begins a new file every few minutes: numbers, times and timecode go on.
TEST(ImportVideo, AClipInSeveralFilesIsOne) {
  Shoot shoot;
  const std::array first_codes = {"10:00:00:00", "10:00:00:12", "10:00:00:24"};
  std::vector<std::string> names;
  for (int part = 0; part < 3; ++part) {
    VideoForm form = form_of({"", "libx264", ".mov", {{"bf", "0"}}});
    form.metadata = {{"timecode", first_codes[static_cast<std::size_t>(part)]}};
    names.push_back(numbered("GX0", part + 1, "0042.mov"));
    shoot.film(names.back(), form, numbered_frames(in_part * part, in_part), its_own_times);
  }
  shoot.json["observer"]["video"] = names;
  const ImportReport report = shoot.import();
  EXPECT_THAT(report.notes, Not(Contains(HasSubstr("is missing, or their order"))));
  expect_all_frames(shoot, 3 * in_part);
  EXPECT_EQ(shoot.open()->records().back().timestamp_ns, (3 * in_part - 1) * 40'000'000);

  // The last two in the wrong order.
  std::swap(names[1], names[2]);
  shoot.json["observer"]["video"] = names;
  EXPECT_THAT(
      shoot.import().notes,
      Contains(AllOf(HasSubstr("begins at timecode 10:00:00:24"), HasSubstr("ends at 10:00:00:12"),
                     HasSubstr("a file between them is missing, or their order is another"))));
  shoot.json["observer"]["video"] = Json::array();
  EXPECT_THAT(shoot.error(), HasSubstr("observer.video is empty"));
}

}  // namespace previz::exchange::import_joined_test
