#include "drivers/faults.hpp"

#include "daemon/core/session/replay_camera.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::faults_test {

using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using Kind = Fault::Kind;

constexpr nanoseconds interval{40'000'003};  // of session::noise_frame

// A take of ten frames, replayed in a time that passes only when somebody sleeps.
class Faults : public testing::Test {
 protected:
  void SetUp() override { session::write_small_session(take(), 10); }
  std::filesystem::path take() const { return directory_ / "take"; }

  HostClock clock() {
    return {[this] { return now_; }, [this](HostClock::Time time) { now_ = std::max(now_, time); }};
  }

  CameraOpener device(std::vector<Fault> plan) {
    ReplayOptions options;
    options.origin = {now_, session::noise_frame("", 0, PixelFormat::rgb8, 1, 1).timestamp_ns};
    options.position = std::make_shared<ReplayPosition>();
    return with_faults([=, this] { return open_replay(take(), "observer", options, clock()); },
                       std::move(plan), clock());
  }

  // One character an event: a frame's last digit, t trouble, L lost, - for any time without a
  // frame.
  std::string story(Camera& camera) {
    std::string story;
    for (int i = 0; i < 30; ++i) {
      const CameraEvent event = camera.next(std::chrono::ceil<milliseconds>(interval));
      if (std::holds_alternative<EndOfStream>(event)) return story;
      if (const auto* frame = std::get_if<FramePtr>(&event))
        story += std::to_string((*frame)->sequence % 10);
      else if (const auto* trouble = std::get_if<DeviceTrouble>(&event))
        story += trouble->lost ? 'L' : 't';
      else if (!story.ends_with('-'))
        story += '-';
      if (story.back() == 'L') return story;
    }
    return story;
  }

  static std::unique_ptr<Camera> started(std::unique_ptr<Camera> camera) {
    camera->start();
    return camera;
  }

  std::string story_of(std::vector<Fault> plan) {
    return story(*started(device(std::move(plan))()));
  }

  test::TemporaryDirectory directory_;
  HostClock::Time now_{};
};

TEST_F(Faults, WithoutAPlanNothingChanges) {
  EXPECT_EQ(story_of({}), "0123456789");
}

TEST_F(Faults, DroppedFramesLeaveAGap) {
  EXPECT_EQ(story_of({{Kind::drop, 3, 2}}), "012-56789");
}

TEST_F(Faults, CorruptFramesAreTroubleInTheirPlace) {
  EXPECT_EQ(story_of({{Kind::corrupt, 0, 1}, {Kind::corrupt, 4, 2}}), "t123tt6789");
}

TEST_F(Faults, LateFramesComeTogetherWhenTheLastIsDue) {
  EXPECT_EQ(story_of({{Kind::late, 2, 3}}), "01-23456789");

  const auto again = started(device({{Kind::late, 2, 3}})());
  std::vector<FramePtr> frames;
  while (frames.size() < 6) {
    CameraEvent event = again->next(milliseconds(100));
    if (auto* frame = std::get_if<FramePtr>(&event)) frames.push_back(std::move(*frame));
  }
  for (int i = 2; i < 5; ++i) {
    EXPECT_EQ(frames[i]->arrival_ns, frames[5]->arrival_ns);
    EXPECT_LT(frames[i]->timestamp_ns, frames[i + 1]->timestamp_ns);
  }
}

TEST_F(Faults, LateFramesComeAtTheEndAtTheLatest) {
  EXPECT_EQ(story_of({{Kind::late, 8, 5}}), "01234567-89");
}

TEST_F(Faults, AStallEndsWithARestart) {
  const auto camera = started(device({{Kind::stall, 3}})());
  for (int i = 0; i < 3; ++i) camera->next(milliseconds(100));
  EXPECT_TRUE(std::holds_alternative<NoFrame>(camera->next(milliseconds(100))));
  camera->stop();
  camera->start();
  EXPECT_EQ(story(*camera), "56789");  // frame 4 is due at 160 ms, and it is 180 ms
}

TEST_F(Faults, ADisconnectedDeviceIsAbsentForItsTime) {
  const CameraOpener open = device({{Kind::disconnect, 2, 1, 3 * interval}});
  {
    const auto camera = started(open());
    EXPECT_EQ(story(*camera), "01L");
    EXPECT_EQ(story(*camera), "L");  // and so it stays
  }
  EXPECT_THROW(open(), Error);
  now_ += 3 * interval;
  const auto camera = started(open());
  EXPECT_EQ(story(*camera), "56789");
}

TEST_F(Faults, TheCableCanBePulled) {
  FaultyDevice device([this] { return open_replay(take(), "observer", {}, clock()); }, {}, clock());
  const auto camera = started(device.open());
  camera->next(milliseconds(100));
  device.unplug();
  EXPECT_EQ(story(*camera), "L");
  EXPECT_THROW(device.open(), Error);
  device.plug();
  EXPECT_EQ(story(*camera), "L");  // this opening is over
  const auto again = started(device.open());
  EXPECT_EQ(story(*again).size(), 10u);
}

TEST(FaultPlan, IsWrittenAsText) {
  EXPECT_EQ(parse_fault("drop@30"), (Fault{Kind::drop, 30, 1, {}}));
  EXPECT_EQ(parse_fault("corrupt@7+2"), (Fault{Kind::corrupt, 7, 2, {}}));
  EXPECT_EQ(parse_fault("late@12+3"), (Fault{Kind::late, 12, 3, {}}));
  EXPECT_EQ(parse_fault("stall@60"), (Fault{Kind::stall, 60, 1, {}}));
  EXPECT_EQ(parse_fault("disconnect@90+1.5s"),
            (Fault{Kind::disconnect, 90, 1, milliseconds(1500)}));
}

TEST(FaultPlan, MistakesAreQuoted) {
  for (const char* text :
       {"", "drop", "drop@", "drop@x", "drop@-1", "drop@1+0", "drop@1+", "drop@1 ", "melt@3",
        "stall@3+2", "disconnect@3", "disconnect@3+2", "disconnect@3+-1s", "disconnect@3+nans"})
    EXPECT_THAT(test::error_of([&] { parse_fault(text); }),
                HasSubstr('"' + std::string(text) + '"'));
}

}  // namespace previz::faults_test
