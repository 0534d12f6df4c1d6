// What does not fit of tags and lens is said while the rig tracks, and no longer than it holds.
#include "daemon/core/live/live_doubts.hpp"

#include "tests/support/tracking_fixture.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::live::live_doubts_test {

using namespace std::chrono_literals;
using testing::HasSubstr;

// Tracks of the table from four places, by a set in which the lens or the tags may be wrong.
std::vector<tracking::Track> tracks_of(const test::TagScene& believed, double print_scale = 1) {
  test::TagScene seen = tracking::table();
  for (set::Tag& tag : seen.tags) tag.size_m *= print_scale;
  std::vector<tracking::Track> tracks;
  for (unsigned i = 0; i < 4; ++i) {
    seen.world_from_camera = test::camera_looking({0.1 - 0.05 * i, -0.6, 0.45}, {0.02, 0.03, 0});
    std::mt19937 random(i);
    const auto tracker =
        tracking::make_apriltag_tracker(tracking::settings_for(believed), believed.lens);
    tracks.push_back(tracker->track(tracking::picture(seen, random)));
  }
  return tracks;
}

class LiveDoubtsTest : public testing::Test {
 protected:
  std::string notice() {
    for (const report::Notice& trouble : reports_.troubles())
      if (trouble.source == "camera pose") return trouble.text;
    return "";
  }
  void add_frames(LiveDoubts& doubts, const std::vector<tracking::Track>& tracks,
                  std::size_t count = LiveDoubts::frames_judged) {
    for (std::size_t i = 0; i < count; ++i) {
      doubts.add(tracks[i % tracks.size()]);
      std::this_thread::sleep_for(100us);  // the thread may hold the lock for a moment
    }
  }

  const test::TagScene table_ = tracking::table();
  ObserverCalibration camera_ = [this] {
    ObserverCalibration camera;
    camera.intrinsics = table_.lens;
    return camera;
  }();
  std::stringbuf log_;
  std::ostream out_{&log_};
  report::Reports reports_{report::lines_to(out_)};
};

TEST_F(LiveDoubtsTest, NamesTheCauseUntilItIsOver) {
  LiveDoubts doubts(tracking::settings_for(table_), camera_, reports_, 10ms);
  const auto wrong = tracks_of(table_, 0.97), right = tracks_of(table_);
  ASSERT_TRUE(test::wait_until("the cause is named", [&] {
    add_frames(doubts, wrong);
    return !notice().empty();
  }));
  EXPECT_THAT(notice(), HasSubstr("tracked frames are off by"));
  EXPECT_THAT(notice(), HasSubstr("all tags measure 97."));
  EXPECT_TRUE(test::wait_until("all is well again", [&] {
    add_frames(doubts, right);
    return notice().empty();
  }));
}

TEST_F(LiveDoubtsTest, SaysNothingOfWhatIsRightOrOfFewFrames) {
  LiveDoubts doubts(tracking::settings_for(table_), camera_, reports_, 10ms);
  const auto wrong = tracks_of(table_, 0.97), right = tracks_of(table_);
  for (int i = 0; i < 3; ++i) add_frames(doubts, right);
  doubts.forget();
  add_frames(doubts, wrong, LiveDoubts::frames_judged - 1);
  // Five times as long as until the next judgement, which must find nothing to say.
  std::this_thread::sleep_for(50ms);
  doubts.forget();
  add_frames(doubts, right);
  std::this_thread::sleep_for(50ms);
  EXPECT_EQ(notice(), "");
}

}  // namespace previz::live::live_doubts_test
