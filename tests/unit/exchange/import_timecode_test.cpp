// The timecode of videos that were trimmed without being written anew: edit lists of QuickTime.
#include "tests/support/import_fixture.hpp"

namespace previz::exchange::import_timecode_test {

constexpr int frame_count = 40;

std::uint32_t number_at(const std::string& bytes, std::size_t at) {
  std::uint32_t number = 0;
  for (std::size_t i = 0; i < 4; ++i)
    number = number << 8 | static_cast<std::uint8_t>(bytes.at(at + i));
  return number;
}

std::string number_of(std::int64_t number, int bytes = 4) {
  std::string text;
  for (int i = bytes; i-- > 0;) text += static_cast<char>(number >> 8 * i & 255);
  return text;
}

// A box of ISO/IEC 14496-12: where it begins, and how many bytes it has.
struct Box {
  std::size_t at, size;
};

Box box_in(const std::string& bytes, Box parent, const std::string& type) {
  for (std::size_t at = parent.at + 8; at < parent.at + parent.size; at += number_at(bytes, at))
    if (bytes.substr(at + 4, 4) == type) return {at, number_at(bytes, at)};
  throw Error("no box " + type);
}

// Times and durations in seconds; time -1: nothing is shown.
struct Edit {
  double duration, time;
};

std::string edit_list(const std::vector<Edit>& edits, double time_scale, bool wide) {
  std::string list = std::string(1, wide ? '\1' : '\0') + std::string(3, '\0') +
                     number_of(static_cast<std::int64_t>(edits.size()));
  for (const Edit& edit : edits)
    list += number_of(std::llround(edit.duration * 1000), wide ? 8 : 4) +
            number_of(edit.time < 0 ? -1 : std::llround(edit.time * time_scale), wide ? 8 : 4) +
            number_of(1 << 16);
  const auto size = static_cast<std::int64_t>(list.size());
  return number_of(size + 16) + "edts" + number_of(size + 8) + "elst" + list;
}

// Puts the edits into the track that has this handler, in a file whose "moov" is its last box.
void edit_track(std::string& bytes, const std::string& handler, const std::vector<Edit>& edits,
                bool wide) {
  const Box moov = box_in(bytes, {std::size_t(-8), bytes.size() + 8}, "moov");
  for (Box track = box_in(bytes, moov, "trak");;
       track = {track.at + track.size, number_at(bytes, track.at + track.size)}) {
    const Box media = box_in(bytes, track, "mdia");
    if (bytes.substr(box_in(bytes, media, "hdlr").at + 16, 4) != handler) continue;
    const double time_scale = number_at(bytes, box_in(bytes, media, "mdhd").at + 20);
    const Box old = box_in(bytes, track, "edts");
    const std::string list = edit_list(edits, time_scale, wide);
    bytes.replace(old.at, old.size, list);
    const auto more = static_cast<std::int64_t>(list.size()) - static_cast<std::int64_t>(old.size);
    for (const Box& of : {moov, track})
      bytes.replace(of.at, 4, number_of(static_cast<std::int64_t>(of.size) + more));
    return;
  }
}

struct Clip {
  int fps, seconds;  // fps frames in so many seconds
  const char* first;
  bool wide = false;  // the edit list's second version
};

// All frames from `from` on; frames have a number each.
std::vector<Edit> from(const Clip& clip, int from_frame) {
  const double frame = double(clip.seconds) / clip.fps;
  return {{(frame_count - from_frame) * frame, from_frame * frame}};
}

// Films a clip with these edits of its video and its timecode; returns the imported timecode.
std::string timecode_of(const Clip& clip, const std::vector<Edit>& video,
                        const std::vector<Edit>& timecode, std::size_t frames) {
  Shoot shoot;
  std::vector<Bytes> pictures;
  for (int i = 0; i < frame_count; ++i)
    pictures.emplace_back(3 * 32 * 16, static_cast<std::uint8_t>(5 * i));
  shoot.film("take.mov",
             {.fps = clip.fps,
              .seconds = clip.seconds,
              .encoder = "png",
              .metadata = {{"timecode", clip.first}}},
             pictures, Json::object());
  const std::filesystem::path file = shoot.folder() / "take.mov";
  std::string bytes = session::content_of(file);
  edit_track(bytes, "vide", video, clip.wide);
  edit_track(bytes, "tmcd", timecode, clip.wide);
  session::write_content(file, bytes);
  shoot.import();
  EXPECT_EQ(shoot.open()->records().size(), frames);
  // Each picture's grey is its number.
  EXPECT_EQ(shoot.open()->read(0)->bytes[0], 5 * (frame_count - frames));
  const session::Session opened = session::open_session(shoot.session());
  return opened.info.timecode ? opened.info.timecode->first : "none";
}

TEST(ImportVideo, TheTimecodeOfATrimmedClipIsThatOfItsFirstFrame) {
  struct Case {
    Clip clip;
    const char* timecode;
  };
  // SMPTE ST 12-1: numbers 00 and 01 are dropped at minute 1.
  for (const Case& trimmed : {Case{{25, 1, "10:00:00:00"}, "10:00:00:17"},
                              Case{{25, 1, "10:00:00:00", true}, "10:00:00:17"},
                              Case{{24000, 1001, "10:00:00:00"}, "10:00:00:17"},
                              Case{{30000, 1001, "10:00:59;20"}, "10:01:00;09"},
                              Case{{50, 1, "10:00:00:40"}, "10:00:01:07"}})
    EXPECT_EQ(timecode_of(trimmed.clip, from(trimmed.clip, 17), from(trimmed.clip, 17), 23),
              trimmed.timecode);
}

// The picture that is shown at a time has the timecode of that time.
TEST(ImportVideo, EditsOfPictureAndTimecodeNeedNotBeTheSame) {
  const Clip clip{25, 1, "10:00:00:00"};
  const std::vector<Edit> whole = from(clip, 0), trimmed = from(clip, 17);
  EXPECT_EQ(timecode_of(clip, whole, whole, 40), "10:00:00:00");
  EXPECT_EQ(timecode_of(clip, whole, trimmed, 40), "10:00:00:17");
  EXPECT_EQ(timecode_of(clip, trimmed, whole, 23), "10:00:00:00");
  // The picture begins after 0.4 s, which are ten frames.
  EXPECT_EQ(timecode_of(clip, {{0.4, -1}, {1.6, 0}}, whole, 40), "10:00:00:10");
  EXPECT_EQ(timecode_of(clip, {{0.4, -1}, {0.92, 17 * 0.04}}, trimmed, 23), "10:00:01:02");
  EXPECT_EQ(timecode_of(clip, {{0.4, -1}, {1.6, 0}}, {{0.4, -1}, {1.6, 0}}, 40), "10:00:00:00");
  // The timecode begins 0.2 s after the picture: it is counted back to the picture's first frame.
  EXPECT_EQ(timecode_of(clip, whole, {{0.2, -1}, {1.4, 10 * 0.04}}, 40), "10:00:00:05");
}

}  // namespace previz::exchange::import_timecode_test
