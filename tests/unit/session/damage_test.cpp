extern "C" {
#include <libavformat/avformat.h>
}

#include "tests/support/child_process.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::session::session_damage_test {

constexpr std::size_t frame_count = 6;

// A whole small session, and copies of it in which one file is not as it was.
class Damage : public testing::Test {
 protected:
  static void SetUpTestSuite() { av_log_set_level(AV_LOG_QUIET); }
  void SetUp() override { write_small_frames(frame_count, 24, 18); }
  void expect_no_changed_byte_is_shown(VideoCodec codec);
  void write_small_frames(int count, int width, int height, VideoCodec codec = VideoCodec::ffv1) {
    width_ = width;
    height_ = height;
    std::filesystem::remove_all(whole());
    std::filesystem::remove_all(copy());
    write_small_session(whole(), count, width, height, codec);
    std::filesystem::copy(whole(), copy());
  }
  std::filesystem::path whole() const { return directory_ / "whole"; }
  std::filesystem::path copy() const { return directory_ / "copy"; }
  // The whole session's film and its lines.
  std::string whole_video() const { return content_of(whole() / "observer.mkv"); }
  std::string whole_lines() const { return content_of(whole() / "observer.jsonl"); }

  struct Opened {
    std::vector<std::uint64_t> frames;  // that came back, each bit for bit
    std::vector<std::string> missing;
  };

  // Opens the copy and reads every frame that it offers; any that is offered must be right.
  Opened open_copy() const {
    Session session = open_session(copy());
    const auto stream = open_stream(session, "observer");
    Opened opened;
    for (std::size_t i = 0; stream && i < stream->records().size(); ++i) {
      const FramePtr frame = stream->read(i);
      const std::uint64_t index = stream->records()[i].frame;
      EXPECT_EQ(frame->bytes,
                noise_frame("observer", index, PixelFormat::rgb8, width_, height_).bytes);
      opened.frames.push_back(index);
    }
    opened.missing = session.missing;
    return opened;
  }

  Opened open_with_video(const std::string& video) const {
    write_content(copy() / "observer.mkv", video);
    return open_copy();
  }
  Opened open_with_lines(const std::string& lines) const {
    write_content(copy() / "observer.jsonl", lines);
    return open_copy();
  }

  static bool is_prefix(const std::vector<std::uint64_t>& frames) {
    for (std::size_t i = 0; i < frames.size(); ++i)
      if (frames[i] != i) return false;
    return true;
  }

 private:
  TemporaryDirectory directory_;
  int width_ = 0, height_ = 0;
};

TEST_F(Damage, AWholeSessionMissesNothing) {
  const Opened opened = open_copy();
  EXPECT_EQ(opened.frames.size(), frame_count);
  EXPECT_TRUE(opened.missing.empty());
}

TEST_F(Damage, AVideoCutAnywhereGivesAPrefix) {
  const std::string video = whole_video();
  std::size_t before = 0;
  for (std::size_t length = 0; length < video.size(); length += 1 + length % 37) {
    const Opened opened = open_with_video(video.substr(0, length));
    EXPECT_TRUE(is_prefix(opened.frames)) << "cut at " << length;
    EXPECT_GE(opened.frames.size(), before) << "cut at " << length;
    if (opened.frames.size() < frame_count) {
      EXPECT_FALSE(opened.missing.empty()) << "cut at " << length;
    }
    before = opened.frames.size();
  }
  EXPECT_EQ(before, frame_count);  // what is cut off last is only the index
}

TEST_F(Damage, LinesCutAnywhereGiveAPrefix) {
  const std::string lines = whole_lines();
  for (std::size_t length = 0; length + 1 < lines.size(); length += 1 + length % 11) {
    const Opened opened = open_with_lines(lines.substr(0, length));
    EXPECT_TRUE(is_prefix(opened.frames)) << "cut at " << length;
    EXPECT_LE(opened.frames.size(), frame_count);
    const auto whole_lines = std::count(lines.begin(), lines.begin() + length, '\n');
    EXPECT_GE(opened.frames.size(), static_cast<std::size_t>(whole_lines));
    if (opened.frames.size() < frame_count) {
      EXPECT_TRUE(mentions(opened.missing, "have no line") &&
                  mentions(opened.missing, " of 6 recorded frames are complete"))
          << "cut at " << length;
    }
  }
}

// Returns where the packets of a video lie in its file, which holds their bytes unchanged.
std::vector<std::pair<std::size_t, std::size_t>> packets_of(const std::filesystem::path& file) {
  const std::string content = content_of(file);
  std::vector<std::pair<std::size_t, std::size_t>> places;
  AVFormatContext* opened = nullptr;
  if (avformat_open_input(&opened, file.c_str(), nullptr, nullptr) < 0) return places;
  AVPacket* packet = av_packet_alloc();
  while (av_read_frame(opened, packet) >= 0) {
    const std::string bytes(reinterpret_cast<const char*>(packet->data),
                            static_cast<std::size_t>(packet->size));
    const std::size_t begin = content.find(bytes);
    if (begin != std::string::npos) places.emplace_back(begin, begin + bytes.size());
    av_packet_unref(packet);
  }
  av_packet_free(&packet);
  avformat_close_input(&opened);
  return places;
}

// Every byte of a small video in turn is changed. A frame that is still offered is the right one
// (open_copy sees to that), and one that is not is reported. A byte of a picture costs exactly that
// picture: each has its checksum. What else is in the file, headers and index, may be repaired.
void Damage::expect_no_changed_byte_is_shown(VideoCodec codec) {
  constexpr std::size_t few = 2;
  write_small_frames(few, 8, 8, codec);
  const std::string video = whole_video();
  const auto packets = packets_of(whole() / "observer.mkv");
  ASSERT_EQ(packets.size(), few);
  std::mt19937 random(2);
  for (std::size_t at = 0; at < video.size(); ++at) {
    std::string damaged = video;
    damaged[at] = static_cast<char>(damaged[at] ^ (1 + random() % 255));
    const Opened opened = open_with_video(damaged);
    if (opened.frames.size() < few) {
      EXPECT_FALSE(opened.missing.empty()) << "byte " << at;
    }
    for (std::size_t p = 0; p < few; ++p)
      if (at >= packets[p].first && at < packets[p].second) {
        EXPECT_EQ(opened.frames, std::vector<std::uint64_t>{1 - p}) << "byte " << at;
      }
  }
}

TEST_F(Damage, AChangedByteOfTheVideoIsNeverShown) {
  expect_no_changed_byte_is_shown(VideoCodec::ffv1);
}

TEST_F(Damage, AChangedByteOfARawVideoIsNeverShown) {
  expect_no_changed_byte_is_shown(VideoCodec::raw);
}

// Where the head of a video lies, before its first cluster, and where that one's picture begins.
std::size_t head_of(const std::string& video) {
  return video.find("\x1f\x43\xb6\x75");
}

// The head is one byte short of being right, is zeros up to some place, or the file lacks it: every
// picture behind it is found by its checksum.
TEST_F(Damage, ATornHeadCostsNoPictureBehindIt) {
  const std::string video = whole_video();
  const std::size_t head = head_of(video);
  ASSERT_NE(head, std::string::npos);
  std::string first_byte = video, zeros = video;
  first_byte[0] = 0;
  std::fill_n(zeros.begin(), head, '\0');
  for (const std::string& torn : {first_byte, zeros, video.substr(head)}) {
    const Opened opened = open_with_video(torn);
    EXPECT_EQ(opened.frames, (std::vector<std::uint64_t>{0, 1, 2, 3, 4, 5}));
    EXPECT_TRUE(mentions(opened.missing, "6 pictures of 6 found one by one"));
    EXPECT_FALSE(mentions(opened.missing, "no picture can be read"));
  }
}

// A block of zeros over head and first pictures costs those it touches; they are named.
TEST_F(Damage, ATornFirstBlockCostsThePicturesInIt) {
  const std::string video = whole_video();
  const auto packets = packets_of(whole() / "observer.mkv");
  ASSERT_EQ(packets.size(), frame_count);
  std::string torn = video;
  std::fill_n(torn.begin(), packets[1].first + 10, '\0');
  const Opened opened = open_with_video(torn);
  EXPECT_EQ(opened.frames, (std::vector<std::uint64_t>{2, 3, 4, 5}));
  EXPECT_TRUE(mentions(opened.missing, "the pictures of frames 0 to 1 are missing"));
  EXPECT_TRUE(mentions(opened.missing, "4 of 6 recorded frames are complete"));
}

// Every byte before the first cluster in turn is zeroed or turned over: none costs a picture.
TEST_F(Damage, NoByteOfTheHeadCostsAPicture) {
  constexpr int few = 2;
  write_small_frames(few, 8, 8);
  const std::string video = whole_video();
  for (std::size_t at = 0; at < head_of(video); ++at) {
    for (const char byte : {'\0', static_cast<char>(~video[at])}) {
      std::string damaged = video;
      damaged[at] = byte;
      EXPECT_EQ(open_with_video(damaged).frames.size(), std::size_t{few}) << "byte " << at;
    }
  }
}

// The video header is made anew from session.toml, and the pictures come back bit for bit, in every
// format and with every number of slices.
TEST_F(Damage, EveryFormatIsReadWithoutAHead) {
  for (const VideoCodec codec : {VideoCodec::ffv1, VideoCodec::raw})
    for (const PixelFormat format : {PixelFormat::rgb8, PixelFormat::rgb16, PixelFormat::gray8,
                                     PixelFormat::gray16, PixelFormat::yuv422p8})
      for (const auto& [width, height] : {std::pair{24, 18}, {160, 120}, {400, 300}, {640, 480}}) {
        const TemporaryDirectory directory;
        const std::filesystem::path take = directory / "take";
        {
          SessionWriter writer(take, {}, std::chrono::seconds(1), codec);
          for (std::uint64_t i = 0; i < 2; ++i)
            writer.write(noise_frame("observer", i, format, width, height));
        }
        std::string video = content_of(take / "observer.mkv");
        std::fill_n(video.begin(), head_of(video), '\0');
        write_content(take / "observer.mkv", video);
        Session session = open_session(take);
        const auto stream = open_stream(session, "observer");
        ASSERT_EQ(stream->records().size(), 2u) << width;
        for (std::size_t i : {1, 0}) EXPECT_TRUE(is_frame(*stream->read(i), i)) << width;
      }
}

// Clusters within clusters, each of which claims the rest of the file: what is looked at again is
// bounded, so that the time grows with the size of the file. A search without that bound would read
// 8 MB for each of half a million clusters, which is 4 TB.
TEST_F(Damage, AFileOfNestedClustersIsSearchedInLinearTime) {
  // A cluster of unknown size, its time of 0 ms, and an element of 2 MB that holds the next one.
  const std::string nested("\x1f\x43\xb6\x75\xff\xe7\x81\x00\xec\x10\x20\x00\x00", 13);
  // The same with elements that are walked through one by one.
  const std::string walked("\x1f\x43\xb6\x75\xff\xe7\x81\x00\xec\x84", 10);
  // A block at a time that is wanted, of all that follows and more than a picture.
  const std::string block("\x1f\x43\xb6\x75\xff\xe7\x81\x00\xa3\x43\x00\x81\x00\x00\x80", 15);
  for (const std::string& unit : {nested, walked, block}) {
    std::string video;
    while (video.size() < (std::size_t{8} << 20)) video += unit;
    const auto start = std::chrono::steady_clock::now();
    EXPECT_TRUE(open_with_video(video).frames.empty());
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    EXPECT_LT(took.count(), 60.0);
  }
}

TEST_F(Damage, AFolderInThePlaceOfTheVideoIsSaid) {
  std::filesystem::remove(copy() / "observer.mkv");
  std::filesystem::create_directory(copy() / "observer.mkv");
  const Opened opened = open_copy();
  EXPECT_TRUE(opened.frames.empty());
  EXPECT_TRUE(mentions(opened.missing, "no picture can be read"));
}

TEST_F(Damage, OneDamagedPictureCostsThatFrameOnly) {
  std::string damaged = whole_video();
  damaged[damaged.size() / 2] ^= 0x10;
  const Opened opened = open_with_video(damaged);
  EXPECT_EQ(opened.frames.size(), frame_count - 1);
  EXPECT_TRUE(mentions(opened.missing, "observer.mkv: the pictures of frame ")) << "sentence";
  EXPECT_TRUE(mentions(opened.missing, "5 of 6 recorded frames are complete"));
}

TEST_F(Damage, AHoleInTheVideoDoesNotShiftTheRest) {
  std::string video = whole_video();
  std::fill(video.begin() + video.size() * 3 / 10, video.begin() + video.size() * 5 / 10, '\0');
  const Opened opened = open_with_video(video);
  EXPECT_GE(opened.frames.size(), 3u);
  EXPECT_LT(opened.frames.size(), frame_count);
  EXPECT_EQ(opened.frames.back(), frame_count - 1);
}

// A changed byte costs the line it is in; where it ended that line, the next one, too.
TEST_F(Damage, ChangedLinesAreLeftOut) {
  std::string lines = whole_lines();
  std::mt19937 random(3);
  for (int round = 0; round < 150; ++round) {
    std::string damaged = lines;
    const std::size_t at = random() % damaged.size();
    damaged[at] = static_cast<char>(random());
    write_content(copy() / "observer.jsonl", damaged);
    const std::size_t cost = lines[at] == '\n' ? 2 : 1;
    const Opened opened = open_copy();
    EXPECT_GE(opened.frames.size() + cost, frame_count) << "round " << round;
    if (opened.frames.size() < frame_count) {
      EXPECT_FALSE(opened.missing.empty()) << "round " << round;
    }
  }
  const auto third = lines.find('\n', lines.find('\n') + 1) + 1;
  lines.replace(third, 5, "#####");
  const Opened opened = open_with_lines(lines);
  EXPECT_EQ(opened.frames, (std::vector<std::uint64_t>{0, 1, 3, 4, 5}));
  EXPECT_TRUE(mentions(opened.missing, "observer.jsonl: line 3 unreadable"));
  EXPECT_TRUE(mentions(opened.missing, "1 picture of observer.mkv"));
}

TEST_F(Damage, NumbersOfTheWrongKindAreDamage) {
  const std::string lines = whole_lines();
  const std::string rest = R"(,"arrival_ns":1,"exposure_s":1,"gain":1,"exposure":1,"video_ms":1,)";
  const std::string sum = R"("crc32":"00000000"})";
  for (const std::string& line :
       {std::string("{}"), std::string("[]"), std::string("null"), std::string("7"),
        std::string(R"({"frame":1e300})"),
        R"({"frame":-1,"sequence":1,"timestamp_ns":1)" + rest + sum,
        R"({"frame":9,"sequence":1,"timestamp_ns":1e40)" + rest + sum,
        R"({"frame":9,"sequence":1,"timestamp_ns":18446744073709551615)" + rest + sum,
        R"({"frame":9,"sequence":1,"timestamp_ns":1)" + rest + R"("crc32":"xyz"})"}) {
    const Opened opened = open_with_lines(lines + line + "\n");
    EXPECT_EQ(opened.frames.size(), frame_count);
    EXPECT_TRUE(mentions(opened.missing, "line 7 unreadable")) << line;
  }
}

TEST_F(Damage, MoreLinesThanPictures) {
  const Opened opened =
      open_with_lines(content_of(whole() / "observer.jsonl") +
                      R"({"frame":6,"sequence":1,"timestamp_ns":1,"arrival_ns":1,"exposure_s":1,)"
                      R"("gain":1,"exposure":1,"video_ms":99999,"crc32":"00000000"})"
                      "\n");
  EXPECT_EQ(opened.frames.size(), frame_count);
  EXPECT_TRUE(mentions(opened.missing, "observer.mkv: the pictures of frame 6 are missing"));
}

TEST_F(Damage, FilesThatAreEmptyOrGone) {
  for (const char* file : {"observer.mkv", "observer.jsonl"}) {
    write_content(copy() / file, "");
    EXPECT_TRUE(open_copy().frames.empty());
    EXPECT_FALSE(open_copy().missing.empty());
    std::filesystem::remove(copy() / file);
    EXPECT_TRUE(open_copy().frames.empty());
    EXPECT_TRUE(mentions(open_copy().missing, std::string(file) + ": the file is missing"));
    std::filesystem::copy(whole() / file, copy() / file,
                          std::filesystem::copy_options::overwrite_existing);
  }
  std::filesystem::remove(copy() / "session.toml");
  EXPECT_THROW(open_copy(), Error);
  write_content(copy() / "session.toml", "\x01\x02 garbage");
  EXPECT_THROW(open_copy(), Error);
}

// The child says so after each frame it has written; then it is killed in the middle of its work.
TEST_F(Damage, AKilledRecordingKeepsEveryWrittenFrame) {
  const std::filesystem::path take = whole().parent_path() / "killed";
  test::ChildProcess recording([&](int tells) {
    SessionWriter writer(take, {});
    for (std::uint64_t i = 0;; ++i) {
      writer.write(noise_frame("observer", i, PixelFormat::rgb8, 64, 48));
      test::tell(tells, i + 1);
    }
  });
  std::uint64_t written = 0;
  while (written < 20) ASSERT_TRUE(recording.is_told(written));
  recording.kill();

  Session session = open_session(take);
  EXPECT_TRUE(mentions(session.missing, "was not closed"));
  const auto stream = open_stream(session, "observer");
  ASSERT_GE(stream->records().size(), written);
  for (std::size_t i = 0; i < stream->records().size(); ++i)
    EXPECT_TRUE(is_frame(*stream->read(i), i)) << "frame " << i;
}

TEST_F(Damage, AnotherSessionsVideoIsNotShown) {
  write_small_session(whole().parent_path() / "other", frame_count, 30, 20);
  std::filesystem::copy(whole().parent_path() / "other" / "observer.mkv", copy() / "observer.mkv",
                        std::filesystem::copy_options::overwrite_existing);
  const Opened opened = open_copy();
  EXPECT_TRUE(opened.frames.empty());
  EXPECT_TRUE(mentions(opened.missing, "30x20"));
}

// A line whose light is not light costs that line; one without any is from an older session.
TEST_F(Damage, LightThatIsNoneCostsItsLine) {
  const std::string source = R"({"id":1,"direction":[0,0,1],"solid_angle_sr":0.01,"flux":[1,2,3]})";
  const auto line = [](const std::string& sources, const std::string& ambient) {
    return R"({"frame":1,"timestamp_ns":1,"tracked":false,"tags":[],"captured_light":{"sources":[)" +
           sources + R"(],"ambient":)" + ambient + "}}\n";
  };
  const std::string ambient = R"({"size":1,"radiance":[0.5,0.5,0.5]})";
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = source;
    return text.replace(text.find(from), from.size(), to);
  };
  const TemporaryDirectory directory;
  SessionWriter(directory.path(), {}).close();
  const auto lines_read = [&](const std::string& second) {
    write_content(directory / "track.jsonl",
                  R"({"frame":0,"timestamp_ns":0,"tracked":false,"tags":[]})"
                  "\n" +
                      second);
    return open_session(directory.path()).track.size();
  };
  EXPECT_EQ(lines_read(line(source, ambient)), 2u);
  for (const std::string& bad :
       {line(changed("[0,0,1]", "[0,0,2]"), ambient), line(changed("[0,0,1]", "[0,1]"), ambient),
        line(changed("0.01", "0"), ambient), line(changed("0.01", "13"), ambient),
        line(changed("[1,2,3]", "[1,2,-3]"), ambient),
        line(changed("[1,2,3]", "[1,2,1e999]"), ambient),
        line(changed("\"id\":1", "\"id\":\"a\""), ambient),
        line(source, R"({"size":2,"radiance":[1,1,1]})"),
        line(source, R"({"size":3,"radiance":[]})"), line(source, R"({"size":128,"radiance":[]})"),
        line(source, "[]")})
    EXPECT_EQ(lines_read(bad), 1u) << bad;
}

TEST_F(Damage, TrackLinesCutAnywhere) {
  const TemporaryDirectory directory;
  {
    SessionWriter writer(directory.path(), {});
    for (int i = 0; i < 3; ++i) {
      TrackRecord record;
      record.frame = i;
      record.tracked = i != 1;
      writer.write(record);
    }
  }
  const std::string lines = content_of(directory / "track.jsonl");
  for (std::size_t length = 0; length < lines.size(); length += 1 + length % 11) {
    write_content(directory / "track.jsonl", lines.substr(0, length));
    const Session session = open_session(directory.path());
    EXPECT_LE(session.track.size(), 3u);
    for (std::size_t i = 0; i < session.track.size(); ++i) EXPECT_EQ(session.track[i].frame, i);
  }
}

}  // namespace previz::session::session_damage_test
