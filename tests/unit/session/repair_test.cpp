// A damaged session is written anew as far as it is whole, and stays as it is itself.
#include "daemon/core/session/repair.hpp"

#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::session::session_repair_test {

namespace fs = std::filesystem;

constexpr std::uint64_t frame_count = 6;

class Repair : public testing::Test {
 protected:
  void SetUp() override {
    write_content(directory_ / "model.glb", "a model");
    SessionInfo info;
    info.name = "small";
    SessionWriter writer(take_, info);
    writer.add_asset("model.glb", directory_ / "model.glb");
    for (std::uint64_t i = 0; i < frame_count; ++i) {
      writer.write(noise_frame("observer", i, PixelFormat::rgb8, 24, 18));
      writer.write(noise_frame("light", i, PixelFormat::gray16, 16, 16));
      TrackRecord record;
      record.frame = i;
      writer.write(record);
      writer.write(ButtonEvent{.button = "a", .pressed = true, .timestamp_ns = 7});
    }
    writer.close();
  }

  std::map<std::string, std::string> contents() const {
    std::map<std::string, std::string> all;
    for (const auto& entry : fs::recursive_directory_iterator(take_))
      if (entry.is_regular_file()) all[entry.path().string()] = content_of(entry.path());
    return all;
  }

  // Zeros over a part of a file, given in tenths of it.
  void wipe(const char* name, std::size_t from, std::size_t to) const {
    std::string content = content_of(take_ / name);
    const auto tenth = static_cast<std::ptrdiff_t>(content.size() / 10);
    std::fill(content.begin() + tenth * static_cast<std::ptrdiff_t>(from),
              content.begin() + tenth * static_cast<std::ptrdiff_t>(to), '\0');
    write_content(take_ / name, content);
  }

  static std::vector<std::uint64_t> frames_of(Session& session, const std::string& source) {
    std::vector<std::uint64_t> frames;
    const auto stream = open_stream(session, source);
    for (std::size_t i = 0; stream && i < stream->records().size(); ++i) {
      frames.push_back(stream->records()[i].frame);
      EXPECT_TRUE(is_frame(*stream->read(i), frames.back()));
    }
    return frames;
  }

  // The frames of the damaged session are those of the repaired one, which misses one thing: what
  // it says was lost.
  void expect_same_frames() {
    const auto before = contents();
    const session::Repair repair = repair_session(take_, repaired_);
    EXPECT_EQ(contents(), before);
    EXPECT_FALSE(repair.is_complete);
    EXPECT_FALSE(repair.lacked.empty());
    Session old_one = open_session(take_), new_one = open_session(repaired_);
    for (const char* source : {"observer", "light"})
      EXPECT_EQ(frames_of(new_one, source), frames_of(old_one, source)) << source;
    EXPECT_EQ(repair.lacked, old_one.missing);
    EXPECT_EQ(new_one.track.size(), old_one.track.size());
    EXPECT_EQ(new_one.missing.size(), 1u);
    for (const std::string& what : repair.lacked) EXPECT_TRUE(mentions(new_one.missing, what));
    EXPECT_TRUE(mentions(new_one.missing, "session.toml: repaired from take"));
  }

  TemporaryDirectory directory_;
  const fs::path take_ = directory_ / "take", repaired_ = directory_ / "repaired";
};

TEST_F(Repair, KeepsEveryWholeFrameOfAHole) {
  wipe("observer.mkv", 3, 5);
  expect_same_frames();
}

TEST_F(Repair, KeepsEveryWholeFrameOfATakeThatWasCut) {
  fs::resize_file(take_ / "light.mkv", fs::file_size(take_ / "light.mkv") / 2);
  std::string toml = content_of(take_ / "session.toml");
  toml.replace(toml.find("closed = true"), 13, "closed = false");
  write_content(take_ / "session.toml", toml);
  expect_same_frames();
}

TEST_F(Repair, KeepsWhatIsBehindATornFirstBlock) {
  wipe("observer.mkv", 0, 4);
  expect_same_frames();
}

TEST_F(Repair, KeepsEveryWholeLine) {
  wipe("observer.jsonl", 2, 4);
  wipe("track.jsonl", 5, 6);
  expect_same_frames();
}

// A head that is torn loses nothing: the new session is whole, and an event says what it is.
TEST_F(Repair, OfATornHeadIsAWholeSession) {
  std::string video = content_of(take_ / "observer.mkv");
  video[0] = '\0';
  write_content(take_ / "observer.mkv", video);
  const session::Repair repair = repair_session(take_, repaired_);
  EXPECT_TRUE(repair.is_complete);
  EXPECT_EQ(repair.frames, frame_count);
  Session session = open_session(repaired_);
  EXPECT_EQ(frames_of(session, "observer").size(), frame_count);
  EXPECT_EQ(frames_of(session, "light").size(), frame_count);
  EXPECT_EQ(session.track.size(), frame_count);
  EXPECT_TRUE(session.missing.empty());
  EXPECT_EQ(content_of(repaired_ / session.info.assets.at("model.glb")), "a model");
  const std::string events = content_of(repaired_ / "events.jsonl");
  EXPECT_TRUE(events.starts_with(content_of(take_ / "events.jsonl")));
  EXPECT_THAT(events, HasSubstr("repaired from take, which was damaged: observer.mkv"));
}

TEST_F(Repair, NamesAnAssetThatWasChanged) {
  const std::string stored = open_session(take_).info.assets.at("model.glb");
  write_content(take_ / stored, "another model");
  EXPECT_FALSE(repair_session(take_, repaired_).is_complete);
  const Session session = open_session(repaired_);
  EXPECT_TRUE(mentions(session.missing, "model.glb: missing from the take, because the take was"));
  EXPECT_FALSE(fs::exists(repaired_ / stored));
}

TEST_F(Repair, LeavesOutAnEventThatIsTorn) {
  write_content(take_ / "events.jsonl", content_of(take_ / "events.jsonl") + "{\"timest");
  const session::Repair repair = repair_session(take_, repaired_);
  EXPECT_FALSE(repair.is_complete);
  EXPECT_TRUE(mentions(repair.lacked, "events.jsonl: line 7 unreadable"));
  EXPECT_THAT(content_of(repaired_ / "events.jsonl"), Not(HasSubstr("{\"timest\n")));
}

TEST_F(Repair, RefusesAPlaceThatIsTaken) {
  fs::create_directories(repaired_);
  EXPECT_THROW(repair_session(take_, repaired_), Error);
  EXPECT_THROW(repair_session(take_, take_), Error);
  EXPECT_THROW(repair_session(take_, take_ / "repaired"), Error);
  EXPECT_TRUE(fs::is_empty(repaired_));
}

TEST_F(Repair, LeavesNothingIfItIsStoppedOrFindsNoFrame) {
  const auto names = [&] { return std::distance(fs::directory_iterator(directory_.path()), {}); };
  const auto before = names();
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(repair_session(take_, repaired_, stop.get_token()), Error);
  EXPECT_EQ(names(), before);
  wipe("observer.mkv", 0, 10);
  wipe("light.jsonl", 0, 10);
  write_content(take_ / "light.jsonl", "");
  write_content(take_ / "observer.jsonl", "");
  EXPECT_THROW(repair_session(take_, repaired_), Error);
  EXPECT_EQ(names(), before);
}

}  // namespace previz::session::session_repair_test
