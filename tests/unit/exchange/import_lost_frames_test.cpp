// Videos of others that are damaged, cut or lack frames: what comes in, when, and with which poses.
#include "tests/support/import_fixture.hpp"

namespace previz::exchange::import_lost_frames_test {

// A texture that moves, so that every frame differs from every other one and refers to others.
std::vector<Bytes> moving_texture(int count, int width, int height) {
  std::vector<Bytes> frames;
  for (int i = 0; i < count; ++i) {
    Bytes bytes;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x)
        bytes.push_back(static_cast<std::uint8_t>(
            128 + 60 * std::sin((x + 3 * i) * 0.3) * std::cos((y + 2 * i) * 0.25) +
            30 * std::sin((x - y + 5 * i) * 0.11)));
    bytes.resize(static_cast<std::size_t>(width * height * 3 / 2), 128);
    frames.push_back(std::move(bytes));
  }
  return frames;
}

struct Timed {
  std::map<std::int64_t, Bytes> frames;  // by their times, in nanoseconds
  std::vector<std::string> notes;
};

Timed import_video(const Shoot& shoot) {
  Timed timed;
  timed.notes = shoot.import().notes;
  const auto stream = shoot.open();
  for (std::size_t i = 0; i < stream->records().size(); ++i) {
    const FramePtr frame = stream->read(i);
    timed.frames[frame->timestamp_ns] = frame->bytes;
  }
  return timed;
}

using Options = std::map<std::string, std::string>;  // of an encoder

struct Damage {
  const char* name;
  const char* encoder;
  const char* file;
  Options options;
  std::size_t at_least;  // so many frames come in
};

std::ostream& operator<<(std::ostream& out, const Damage& damage) {
  return out << damage.name;
}

class ImportVideoWithAHole : public testing::TestWithParam<Damage> {};
class ImportTruncatedVideo : public testing::TestWithParam<Damage> {};

constexpr int texture_frames = 48;
const Json its_own_times = Json::object();  // no rate beside the video

using Spoil = std::function<bool(AVPacket&, int)>;

void film(Shoot& shoot, const Damage& damage, Spoil spoil) {
  const VideoForm form = {
      .pixel_format = std::string(damage.encoder) == "mjpeg" ? "yuvj420p" : "yuv420p",
      .width = 160,
      .height = 96,
      .encoder = damage.encoder,
      .options = damage.options,
      .spoil = std::move(spoil)};
  shoot.film(damage.file, form, moving_texture(texture_frames, 160, 96), its_own_times);
}

Timed import_video(const Damage& damage, Spoil spoil) {
  Shoot shoot;
  film(shoot, damage, std::move(spoil));
  return import_video(shoot);
}

// The packets of one encoding, for two files: x264 reads memory that is not its own, so that it
// does not make the same packets twice.
class Packets {
 public:
  Spoil kept() {
    return [this](AVPacket& packet, int) {
      packets_.emplace_back(av::made(av_packet_clone(&packet)));
      return true;
    };
  }
  // Puts them in the place of another encoding's.
  Spoil again(Spoil spoil) {
    return [this, spoil = std::move(spoil)](AVPacket& packet, int number) {
      av_packet_unref(&packet);
      av_packet_ref(&packet, packets_.at(static_cast<std::size_t>(number)).get());
      av_packet_make_writable(&packet);
      return spoil(packet, number);
    };
  }

 private:
  std::vector<av::Packet> packets_;
};

void expect_same_frames(const Timed& damaged, const Timed& whole) {
  for (const auto& [time, bytes] : damaged.frames) {
    const auto found = whole.frames.find(time);
    ASSERT_NE(found, whole.frames.end()) << "a frame at " << time << " is not in the whole video";
    EXPECT_TRUE(bytes == found->second) << "the frame at " << time << " is another picture";
  }
}

// As a bad sector and a full disk leave a packet: half of it nought, or its second half gone. (Of
// bytes that are merely others no decoder can tell: most of them say something.)
void zero_half(AVPacket& packet) {
  std::fill(packet.data + packet.size / 4, packet.data + packet.size * 3 / 4, std::uint8_t{0});
}
void cut_half(AVPacket& packet) {
  av_shrink_packet(&packet, packet.size / 2);
}

void expect_lost_frames_only(const Damage& damage, void (*harm)(AVPacket&)) {
  Packets packets;
  const Timed whole = import_video(damage, packets.kept());
  ASSERT_EQ(whole.frames.size(), std::size_t{texture_frames});
  const Timed damaged = import_video(damage, packets.again([&](AVPacket& packet, int number) {
    if (number == 14) harm(packet);
    return true;
  }));
  expect_same_frames(damaged, whole);
  EXPECT_LT(damaged.frames.size(), whole.frames.size());
  EXPECT_GE(damaged.frames.size(), damage.at_least);
  const std::string lost = std::to_string(whole.frames.size() - damaged.frames.size());
  EXPECT_THAT(
      damaged.notes,
      Contains(HasSubstr(": " + lost + (lost == "1" ? " frame is lost" : " frames are lost"))));
}

TEST_P(ImportVideoWithAHole, NoFrameThatRefersToALostOneComesIn) {
  expect_lost_frames_only(GetParam(), zero_half);
}

TEST_P(ImportTruncatedVideo, NoFrameThatRefersToALostOneComesIn) {
  expect_lost_frames_only(GetParam(), cut_half);
}

// The most that may be lost: a group of 12, and the frames before the next key frame in time.
constexpr std::size_t all_but_a_group = texture_frames - 15;
const Options groups = {{"g", "12"}, {"bf", "2"}};
const Options groups_of_hevc = {{"g", "12"},
                                {"x265-params", "log-level=none:pools=none:bframes=2"}};
const Damage mjpeg{"mjpeg", "mjpeg", "take.avi", {}, texture_frames - 1};
const Damage h264{"h264", "libx264", "take.mp4", groups, all_but_a_group};
const Damage hevc{"hevc", "libx265", "take.mkv", groups_of_hevc, all_but_a_group};
const Damage mpeg4{"mpeg4", "mpeg4", "take.mp4", groups, all_but_a_group};
const Damage mpeg2{"mpeg2", "mpeg2video", "take.mkv", groups, all_but_a_group};

std::string name_of(const testing::TestParamInfo<Damage>& damage) {
  return damage.param.name;
}
// Nought bytes mean something in MJPEG, and libav's decoder of HEVC takes what ends early for
// whole.
INSTANTIATE_TEST_SUITE_P(Codecs, ImportVideoWithAHole, testing::Values(h264, hevc, mpeg4, mpeg2),
                         name_of);
INSTANTIATE_TEST_SUITE_P(Codecs, ImportTruncatedVideo, testing::Values(mjpeg, h264, mpeg4, mpeg2),
                         name_of);

// Where in the second half of a transport stream a packet begins that goes on with a picture
// (ISO/IEC 13818-1, 2.4.3.2): the payload begins no unit, and it belongs to libav's first stream.
std::size_t continuing_packet(const std::string& stream) {
  for (std::size_t i = stream.size() / 188 / 2 * 188; i < stream.size(); i += 188)
    if ((stream[i + 1] & 0x5f) == 0x01 && stream[i + 2] == 0x00) return i;
  throw Error("no picture fills more than one packet");
}

// As a receiver of a stream has it: one of its packets of 188 bytes never came.
TEST(ImportVideo, ATransportStreamThatLostPacketsComesInWithoutTheirFrames) {
  for (const char* encoder : {"libx264", "libx265"}) {
    Damage stream{"ts", encoder, "take.ts", {{"g", "12"}}, 0};
    if (std::string(encoder) == "libx265")
      stream.options["x265-params"] = "log-level=none:pools=none";
    Shoot shoot;
    film(shoot, stream, nullptr);
    const Timed whole = import_video(shoot);
    ASSERT_EQ(whole.frames.size(), std::size_t{texture_frames});
    std::string bytes = session::content_of(shoot.folder() / "take.ts");
    bytes.erase(continuing_packet(bytes), 188);
    session::write_content(shoot.folder() / "take.ts", bytes);
    const Timed damaged = import_video(shoot);
    EXPECT_LT(damaged.frames.size(), whole.frames.size());
    EXPECT_GE(damaged.frames.size(), std::size_t{texture_frames - 16});
    expect_same_frames(damaged, whole);
  }
}

// What was cut away before an open group's key frame is lost at the beginning; the numbers and
// times of the others count from what is in the file.
TEST(ImportVideo, ACutAtAnOpenGroupOfPicturesComesIn) {
  Options options = groups;
  options["x264-params"] = "open-gop=1:scenecut=0";
  const Damage open_group{"", "libx264", "take.mkv", options, 0};
  Packets packets;
  const Timed whole = import_video(open_group, packets.kept());
  ASSERT_EQ(whole.frames.size(), std::size_t{texture_frames});
  int first = 0;
  const Timed cut = import_video(open_group, packets.again([&](AVPacket& packet, int number) {
    if (number > 0 && packet.flags & AV_PKT_FLAG_KEY && first == 0) first = number;
    return first > 0;
  }));
  // All but those between two of the frames that the key frame is one of: at most the two B-frames.
  const auto left = static_cast<std::size_t>(texture_frames - first);
  EXPECT_GE(cut.frames.size(), left - 2);
  EXPECT_LT(cut.frames.size(), left + 1);
  // The frames are the last ones of the whole.
  auto from_end = whole.frames.rbegin();
  for (auto frame = cut.frames.rbegin(); frame != cut.frames.rend(); ++frame, ++from_end)
    EXPECT_TRUE(frame->second == from_end->second) << "the frame at " << frame->first;
}

// A phone's clip that lost one frame while it was filmed, with a track of timecode.
void film_by_a_phone(Shoot& shoot, const Json& more) {
  VideoForm form = {
      .width = 48, .fps = 30, .encoder = "png", .metadata = {{"timecode", "10:59:59:20"}}};
  for (std::int64_t i = 0; i < 60; ++i)
    if (i != 20) form.times.push_back(i);
  shoot.film("take.mov", form, std::vector<Bytes>(59, Bytes(3 * 48 * 16, 90)), more);
}

TEST(ImportVideo, TheRateIsTheNominalOneAndTheTimecodeTheClips) {
  Shoot shoot;
  film_by_a_phone(shoot, its_own_times);
  EXPECT_THAT(shoot.import().notes,
              Contains("observer: 30 frames per second; 1 frame is missing, after frame 19"));
  const session::Session opened = session::open_session(shoot.session());
  EXPECT_EQ(opened.info.timecode, (session::Timecode{"10:59:59:20", 30}));
}

// A rate beside the clip counts its frames, and so hides the one that is missing: that is said.
TEST(ImportVideo, ARateThatHidesAMissingFrameIsSaid) {
  Shoot shoot;
  film_by_a_phone(shoot, {{"fps", 30}});
  EXPECT_THAT(shoot.import().notes,
              Contains(AllOf(HasSubstr("observer.fps = 30 takes the place of the times in "),
                             HasSubstr("take.mov, which are up to 0.0333 s away"))));
}

// Nothing but nought in one packet.
Spoil blank(int lost) {
  return [lost](AVPacket& packet, int number) {
    if (number == lost) std::fill_n(packet.data, packet.size, std::uint8_t{0});
    return true;
  };
}

// The timecode of the file is that of its first frame, which was lost.
TEST(ImportVideo, TheTimecodeIsThatOfTheFirstFrameThatCameIn) {
  const VideoForm form = {.pixel_format = "yuvj420p",
                          .width = 48,
                          .encoder = "mjpeg",
                          .metadata = {{"timecode", "10:59:59:24"}},
                          .spoil = blank(0)};
  Shoot shoot;
  shoot.film("take.mov", form, std::vector<Bytes>(10, Bytes(48 * 16 * 3 / 2, 90)), its_own_times);
  ASSERT_EQ(shoot.error(), "");
  const session::Session opened = session::open_session(shoot.session());
  EXPECT_EQ(opened.info.timecode, (session::Timecode{"11:00:00:00", 25}));
}

// A pose belongs to its frame, not to the one that takes its place.
TEST(ImportVideo, PosesOfLostFramesAreLeftOut) {
  Shoot shoot;
  film(shoot, mjpeg, blank(1));
  for (const int frame : {0, 1, 2})
    shoot.json["track"].push_back(
        {{"frame", frame},
         {"world_from_camera", {{1, 0, 0, frame}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}}}});
  const ImportReport report = shoot.import();
  EXPECT_EQ(report.observer_frames, std::uint64_t{texture_frames - 1});
  EXPECT_EQ(report.poses, 2u);
  EXPECT_THAT(report.notes.back(), HasSubstr("1 pose belongs to a lost frame"));
  const auto stream = shoot.open();
  EXPECT_EQ(stream->read(1)->sequence, 2u);
  EXPECT_EQ(stream->read(1)->timestamp_ns, 80'000'000);
}

}  // namespace previz::exchange::import_lost_frames_test
