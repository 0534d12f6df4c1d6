// The tracked and lit shots of a recorded take.
#include "daemon/core/pipeline/take_shots.hpp"
#include "daemon/core/session/files.hpp"
#include "drivers/plate.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::pipeline::take_shots_test {

class TakeShotsTest : public testing::Test {
 protected:
  void SetUp() override {
    test::write_small_take(directory_.path());
    take_ = open_take(directory_ / "session", {});
  }

  std::vector<Shot> all(const TakeShotsOptions& options = {}) const {
    std::vector<Shot> shots;
    for (Shot& shot : TakeShots(take_, options)) shots.push_back(std::move(shot));
    return shots;
  }

  // Replaces words of the session's own description, from `first` up to the next quote.
  void replace_quoted(const std::string& first, const std::string& by) {
    const std::filesystem::path toml = directory_ / "session/session.toml";
    std::string text = test::content_of(toml);
    const std::size_t begin = text.find(first);
    ASSERT_NE(begin, std::string::npos);
    const std::size_t end = text.find('"', begin + 1);
    text.replace(begin, end + 1 - begin, '"' + by + '"');
    std::ofstream(toml) << text;
  }

  test::TemporaryDirectory directory_;
  Take take_;
};

TEST_F(TakeShotsTest, EveryFrameComesOnceWithItsPoseAndItsLight) {
  const std::vector<Shot> shots = all();
  ASSERT_EQ(shots.size(), std::size_t{test::small_take_frames});
  for (std::size_t i = 0; i < shots.size(); ++i) {
    EXPECT_EQ(shots[i].index, i);
    EXPECT_EQ(shots[i].frame->sequence, i);
    EXPECT_TRUE(shots[i].tracking_done);
    EXPECT_EQ(shots[i].track.pose.has_value(), i != test::small_take_lost) << i;
    if (shots[i].track.pose) {
      EXPECT_EQ(shots[i].track.pose->world_from_camera[3].y, 0.01 * static_cast<double>(i));
    }
    EXPECT_EQ(shots[i].light != nullptr, i != test::small_take_unlit) << i;
  }
  EXPECT_EQ(shots[1].light, shots.back().light);  // the same light frames
}

// Whatever session.toml says, files outside of the session are not read as its assets.
TEST_F(TakeShotsTest, ATakeCannotMakeForeignFilesItsAssets) {
  replace_quoted("\"assets/", "../floor.gltf");
  const session::Session read = session::open_session(directory_ / "session");
  ASSERT_EQ(read.missing.size(), 1u);
  EXPECT_THAT(read.missing[0], HasSubstr("lies outside the session"));
  EXPECT_EQ(read.info.assets.size(), 1u);
}

// The session's own models may have no parts in other files.
TEST_F(TakeShotsTest, ATakeCannotReadForeignFilesByWayOfItsModels) {
  for (const auto& entry : std::filesystem::directory_iterator(directory_ / "session/assets"))
    std::ofstream(entry.path()) << R"({"asset": {"version": "2.0"},
                                       "buffers": [{"uri": "../../secret", "byteLength": 4}]})";
  EXPECT_THROW(open_take(directory_ / "session", {}), Error);
  EXPECT_NO_THROW(open_take(directory_ / "session", {}, true));
}

TEST_F(TakeShotsTest, ATakeIsReadInItsOwnFolderWhateverItsSetIsCalled) {
  replace_quoted("\"set.toml\"", "../../set.toml");
  EXPECT_EQ(open_take(directory_ / "session", {}).set.file, directory_ / "session/set.toml");
}

TEST_F(TakeShotsTest, FirstAndLastAreInTheRange) {
  TakeShotsOptions options;
  options.first = 2;
  options.last = 4;
  const std::vector<Shot> shots = all(options);
  ASSERT_EQ(shots.size(), 3u);
  EXPECT_EQ(shots.front().index, 2u);
  EXPECT_EQ(shots.back().index, 4u);
  options.first = options.last = test::small_take_frames;
  EXPECT_THROW(all(options), Error);
}

// Which frames are wanted may depend on the shots before.
TEST_F(TakeShotsTest, AFrameIsAskedForWhenItsTurnHasCome) {
  std::uint64_t next = 1;
  TakeShotsOptions options;
  options.wanted = [&](std::uint64_t frame) { return frame >= next; };
  std::vector<std::uint64_t> came;
  for (const Shot& shot : TakeShots(take_, options)) {
    came.push_back(shot.index);
    next = shot.index + 3;
  }
  EXPECT_EQ(came, (std::vector<std::uint64_t>{1, 4, 7}));
}

// With unseen = "observer" the light is made of the earlier pictures too, so they are gone through.
TEST_F(TakeShotsTest, WhereTheLightRemembersAShotIsWhatAPassThroughTheTakeGives) {
  TakeShotsOptions options;
  options.first = options.last = 5;
  const auto tracked = [&](set::UnseenRule unseen) {
    Metrics metrics;
    options.metrics = &metrics;
    options.lighting = take_.set.lighting;
    options.lighting->unseen = unseen;
    options.lighting->smoothing_s = 0;  // the light remembers nothing by itself
    EXPECT_EQ(all(options).size(), 1u);
    options.metrics = nullptr;
    return metrics.snapshot(1).stages.at("tracking").frames;
  };
  EXPECT_EQ(tracked(set::UnseenRule::horizon), 1u);
  EXPECT_EQ(tracked(set::UnseenRule::observer), 6u);
  options.from_start = false;
  EXPECT_EQ(tracked(set::UnseenRule::observer), 1u);
  options.from_start = true;

  const auto fifth = all(options);
  options.first = 0;
  const auto whole = all(options);
  EXPECT_EQ(fifth[0].light->lighting.environment.radiance,
            whole[5].light->lighting.environment.radiance);
}

TEST_F(TakeShotsTest, AStopEndsTheRange) {
  std::stop_source stop;
  TakeShotsOptions options;
  options.stop = stop.get_token();
  std::size_t came = 0;
  for ([[maybe_unused]] const Shot& shot : TakeShots(take_, options))
    if (++came == 2) stop.request_stop();
  EXPECT_EQ(came, 2u);
}

TEST_F(TakeShotsTest, ATakeWithoutLightFramesIsRefusedWhereTheyAreNeeded) {
  take_.light_stream.reset();
  EXPECT_THROW(all(), Error);
  TakeShotsOptions options;
  options.lighting = take_.set.lighting;
  options.lighting->from = set::LightFrom::set;
  EXPECT_EQ(all(options).size(), std::size_t{test::small_take_frames});
}

TEST_F(TakeShotsTest, AFrameIsConvertedOnce) {
  Shot shot = all().at(1);
  const PlatePtr plate = plate_of(shot);
  EXPECT_EQ(plate->samples, to_plate(*shot.frame).samples);
  EXPECT_EQ(plate_of(shot), plate);
}

// A take of hours is read as a whole before its first picture, and nobody may have to wait for
// that.
TEST_F(TakeShotsTest, AStopEndsTheReadingOfATake) {
  std::stop_source stop;
  stop.request_stop();
  const std::filesystem::path session = directory_ / "session";
  EXPECT_THAT(test::error_of([&] { open_take(session, {}, false, stop.get_token()); }),
              HasSubstr(".gltf: reading interrupted"));
  session::Session opened = session::open_session(session);
  EXPECT_THAT(test::error_of([&] { session::open_stream(opened, "observer", stop.get_token()); }),
              HasSubstr("observer.mkv: reading interrupted"));
}

}  // namespace previz::pipeline::take_shots_test
