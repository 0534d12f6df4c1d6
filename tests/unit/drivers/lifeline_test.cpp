// A device that comes and goes, in a time that passes only when somebody sleeps.
#include "drivers/lifeline.hpp"

#include "daemon/core/session/replay_camera.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::lifeline_test {

using std::chrono::milliseconds;
using namespace std::chrono_literals;
using Kind = Fault::Kind;

constexpr LifelineOptions options{5000ms, 2000ms, 1000ms, {250ms, 4000ms}};

class LifelineTest : public testing::Test {
 protected:
  void SetUp() override {
    session::write_small_session(directory_ / "take", 10);
    replay_.loop = true;
    replay_.origin = {now_, session::noise_frame("", 0, PixelFormat::rgb8, 1, 1).timestamp_ns};
    replay_.position = std::make_shared<ReplayPosition>();
  }

  HostClock clock() {
    return {[this] { return now_; }, [this](HostClock::Time time) { now_ = std::max(now_, time); }};
  }

  CameraOpener take() {
    return [this] { return open_replay(directory_ / "take", "observer", replay_, clock()); };
  }

  Lifeline started(CameraOpener open, LifelineHooks hooks = {}) {
    Lifeline lifeline("observer", std::move(open), options, clock(), std::move(hooks));
    lifeline.start();
    return lifeline;
  }
  // Starts a lifeline over a device with faults.
  Lifeline started(CameraOpener open, std::vector<Fault> plan, LifelineHooks hooks = {}) {
    return started(with_faults(std::move(open), std::move(plan), clock()), std::move(hooks));
  }
  // Returns an opener that keeps the times of its attempts, and has no device before a time.
  CameraOpener take_from(milliseconds begin) {
    return [=, this]() -> std::unique_ptr<Camera> {
      attempts_ms_.push_back(static_cast<int>(elapsed().count()));
      if (elapsed() < begin) throw Error("is not there");
      return take()();
    };
  }

  milliseconds elapsed() const {
    return std::chrono::floor<milliseconds>(now_ - HostClock::Time{});
  }

  // Returns what is reported until `end`: one letter for a frame, and the words of trouble between.
  std::string story(Lifeline& lifeline, milliseconds end) {
    std::string story;
    while (elapsed() < end) {
      const CameraEvent event = lifeline.next(100ms);
      if (std::holds_alternative<FramePtr>(event)) {
        if (!story.ends_with('f')) story += 'f';
      } else if (const auto* trouble = std::get_if<DeviceTrouble>(&event)) {
        EXPECT_EQ(trouble->device, "observer");
        EXPECT_FALSE(trouble->lost);
        story += " [" + trouble->what + "] ";
      } else if (std::holds_alternative<EndOfStream>(event)) {
        return story + " end";
      }
    }
    return story;
  }

  test::TemporaryDirectory directory_;
  ReplayOptions replay_;
  HostClock::Time now_{};
  std::vector<int> attempts_ms_;
};

TEST_F(LifelineTest, ADeviceThatIsWellIsJustACamera) {
  Lifeline lifeline = started(take());
  EXPECT_EQ(lifeline.state(), DeviceState::absent);
  EXPECT_EQ(story(lifeline, 3000ms), "f");
  EXPECT_EQ(lifeline.state(), DeviceState::streaming);
  EXPECT_EQ(lifeline.format().width, 24);
  EXPECT_EQ(lifeline.counters().at("opened"), 1u);
  lifeline.stop();
  EXPECT_EQ(lifeline.state(), DeviceState::absent);
  EXPECT_TRUE(std::holds_alternative<NoFrame>(lifeline.next(100ms)));
}

// Attempts at 0, 250, 750, 1750, 3750, 7750 ms, and from then on every 4 s.
TEST_F(LifelineTest, AnAbsentDeviceIsTriedEverLessOftenAndToldOnce) {
  Lifeline lifeline = started(take_from(12'000ms));
  EXPECT_EQ(story(lifeline, 17'000ms), " [is not there; retrying until it is available] f");
  EXPECT_EQ(attempts_ms_, (std::vector<int>{0, 250, 750, 1750, 3750, 7750, 11'750, 15'750}));
  EXPECT_EQ(lifeline.counters().at("not opened"), 7u);
  EXPECT_EQ(lifeline.counters().at("back-offs"), 7u);
  EXPECT_EQ(lifeline.counters().at("returned"), 0u);
}

TEST_F(LifelineTest, ADeviceThatNeverStartsIsOpenedAnew) {
  Lifeline lifeline = started(take(), {{Kind::stall, 0}});
  EXPECT_EQ(story(lifeline, 6000ms),
            " [sends no frame within 5000 ms of its start; reopening it] f");
  EXPECT_EQ(lifeline.counters().at("opened"), 2u);
  EXPECT_EQ(lifeline.counters().at("lost"), 1u);
}

TEST_F(LifelineTest, AStalledDeviceIsToldThenLostThenBack) {
  Lifeline lifeline = started(take(), {{Kind::stall, 20}});
  std::vector<DeviceState> states;
  for (int i = 0; i < 60; ++i) {
    lifeline.next(100ms);
    if (states.empty() || states.back() != lifeline.state()) states.push_back(lifeline.state());
  }
  EXPECT_EQ(states, (std::vector{DeviceState::streaming, DeviceState::stalled, DeviceState::lost,
                                 DeviceState::streaming}));
  EXPECT_EQ(lifeline.counters().at("stalled"), 1u);
  EXPECT_EQ(lifeline.counters().at("lost"), 1u);
  EXPECT_EQ(lifeline.counters().at("returned"), 1u);
}

TEST_F(LifelineTest, AStallThatEndsByItselfIsNotGivenUp) {
  // 60 frames of 40 ms are 2.4 s: longer than the stall time-out, shorter than the patience.
  Lifeline lifeline = started(take(), {{Kind::drop, 20, 60}});
  EXPECT_EQ(story(lifeline, 6000ms), "f [has sent nothing for 2000 ms] f");
  EXPECT_EQ(lifeline.counters().at("opened"), 1u);
}

TEST_F(LifelineTest, ALostDeviceIsPickedUpWhenItIsBack) {
  Lifeline lifeline = started(take(), {{Kind::disconnect, 20, 1, 3s}});
  EXPECT_EQ(story(lifeline, 9000ms),
            "f [was unplugged; reopening it] "
            " [the device is unplugged; retrying until it is available] f");
  EXPECT_EQ(lifeline.state(), DeviceState::streaming);
}

TEST_F(LifelineTest, TroubleOfOneFrameIsPassedOn) {
  Lifeline lifeline = started(take(), {{Kind::corrupt, 3}});
  EXPECT_EQ(story(lifeline, 1000ms), "f [frame 103 is damaged and skipped] f");
  EXPECT_EQ(lifeline.counters().at("opened"), 1u);
}

TEST_F(LifelineTest, TheEndOfATakeIsTheEnd) {
  replay_.loop = false;
  Lifeline lifeline = started(take());
  EXPECT_EQ(story(lifeline, 1000ms), "f end");
  EXPECT_TRUE(std::holds_alternative<NoFrame>(lifeline.next(0ms)));
}

TEST_F(LifelineTest, ADeviceMayComeBackWithAnotherFormat) {
  session::write_small_session(directory_ / "other", 10, 40, 30);
  int opened = 0;
  Lifeline lifeline = started(
      [&] {
        const char* name = opened++ == 0 ? "take" : "other";
        return open_replay(directory_ / name, "observer", replay_, clock());
      },
      {{Kind::disconnect, 5, 1, 0ms}});
  for (int i = 0; i < 30; ++i) {
    const CameraEvent event = lifeline.next(100ms);
    const auto* frame = std::get_if<FramePtr>(&event);
    if (!frame) continue;
    EXPECT_EQ((*frame)->width, lifeline.counters().at("opened") == 1 ? 24 : 40);
  }
  EXPECT_EQ(lifeline.format().height, 30);
}

// A driver that throws where an exposure is set, and at every call for a frame after some.
class Throwing final : public Camera {
 public:
  Throwing(std::unique_ptr<Camera> camera, int good_calls)
      : camera_(std::move(camera)), good_calls_(good_calls) {}
  std::string name() const override { return camera_->name(); }
  CameraFormat format() const override { return camera_->format(); }
  void start() override { camera_->start(); }
  void stop() override { camera_->stop(); }
  CameraEvent next(milliseconds timeout) override {
    if (good_calls_ == 0) throw Error("lamp fell down");
    --good_calls_;
    return camera_->next(timeout);
  }
  bool set_exposure(double, double) override { throw Error("lamp fell down"); }
  DeviceCounters counters() const override { return camera_->counters(); }

 private:
  std::unique_ptr<Camera> camera_;
  int good_calls_;
};

TEST_F(LifelineTest, ADeviceWhoseDriverThrowsIsOpenedAnew) {
  int openings = 0;
  Lifeline lifeline = started([&]() -> std::unique_ptr<Camera> {
    if (++openings > 1) return take()();
    return std::make_unique<Throwing>(take()(), 3);
  });
  EXPECT_EQ(story(lifeline, 2000ms), "f [has failed: lamp fell down; reopening it] f");
  EXPECT_EQ(lifeline.counters().at("lost"), 1u);
  EXPECT_EQ(lifeline.counters().at("returned"), 1u);
}

TEST_F(LifelineTest, AnExposureThatCannotBeSetKeepsNoDeviceFromBeingOpened) {
  Lifeline lifeline = started([&] { return std::make_unique<Throwing>(take()(), 1000); });
  EXPECT_TRUE(lifeline.set_exposure(0.25, 1));  // there is no device yet
  EXPECT_EQ(story(lifeline, 300ms), " [lamp fell down; retrying until it is available] f");
}

TEST_F(LifelineTest, SequenceNumbersIncreaseOverAllOpenings) {
  std::uint64_t openings = 0;
  Lifeline lifeline = started(
      [&] {
        replay_.position = std::make_shared<ReplayPosition>();  // counts from the beginning again
        ++openings;
        return open_replay(directory_ / "take", "observer", replay_, clock());
      },
      {{Kind::disconnect, 5, 1, 0ms}});
  std::vector<std::uint64_t> sequences;
  while (sequences.size() < 12) {
    const CameraEvent event = lifeline.next(100ms);
    if (const auto* frame = std::get_if<FramePtr>(&event)) sequences.push_back((*frame)->sequence);
  }
  EXPECT_EQ(openings, 2u);
  std::vector<std::uint64_t> expected(sequences.size());
  std::iota(expected.begin(), expected.end(), sequences.front());
  EXPECT_EQ(sequences, expected);
}

TEST_F(LifelineTest, ADeviceThatIsPluggedInIsNotKeptWaiting) {
  std::uint64_t arrivals = 3;
  Lifeline lifeline = started(take_from(5100ms), LifelineHooks{[&] { return arrivals; }, {}});
  story(lifeline, 5000ms);
  arrivals = 4;  // its node follows 100 ms later
  EXPECT_EQ(story(lifeline, 6000ms), "f");
  EXPECT_EQ(attempts_ms_, (std::vector<int>{0, 250, 750, 1750, 3750, 5000, 5250}));
}

TEST_F(LifelineTest, ADeviceThatIsSilentIsResetBeforeItIsOpenedAnew) {
  for (const char* why_not : {"", "Access denied"}) {
    now_ = {};
    replay_.position = std::make_shared<ReplayPosition>();
    Lifeline lifeline = started(take(), {{Kind::stall, 5}},
                                {{}, [&] { return std::optional<std::string>(why_not); }});
    const std::string said = *why_not
                                 ? "is stalled; it cannot be reset (Access denied); reopening it"
                                 : "is stalled; it was reset; reopening it";
    EXPECT_EQ(story(lifeline, 5000ms), "f [has sent nothing for 2000 ms]  [" + said + "] f");
    EXPECT_EQ(lifeline.counters().at("reset"), *why_not ? 0u : 1u);
  }
}

// It says itself that it is gone: there is nothing to reset.
TEST_F(LifelineTest, ADeviceThatIsPulledIsNotReset) {
  Lifeline lifeline =
      started(take(), {{Kind::disconnect, 5}}, {{}, [] { return std::optional<std::string>(""); }});
  EXPECT_EQ(story(lifeline, 2000ms), "f [was unplugged; reopening it] f");
  EXPECT_EQ(lifeline.counters().at("reset"), 0u);
}

// A device as a recorder of what it is asked.
class Asked final : public Camera {
 public:
  explicit Asked(std::vector<double>& exposures, std::vector<std::string> doubts = {})
      : exposures_(exposures), doubts_(std::move(doubts)) {}
  std::string name() const override { return "asked"; }
  CameraFormat format() const override { return {}; }
  std::vector<std::string> doubts() const override { return doubts_; }
  void start() override {}
  void stop() override {}
  CameraEvent next(milliseconds) override { return DeviceTrouble{"asked", "is gone", true}; }
  bool set_exposure(double exposure_s, double) override {
    exposures_.push_back(exposure_s);
    return true;
  }
  DeviceCounters counters() const override { return {{"frames cut short", 2}}; }

 private:
  std::vector<double>& exposures_;
  const std::vector<std::string> doubts_;
};

TEST_F(LifelineTest, ExposuresAndCountersOutliveAnOpening) {
  std::vector<double> exposures;
  Lifeline lifeline = started([&] { return std::make_unique<Asked>(exposures); });
  EXPECT_TRUE(lifeline.set_exposure(0.25, 1));
  story(lifeline, 800ms);  // opened at 0, 250 and 750 ms
  EXPECT_EQ(exposures, (std::vector<double>{0.25, 0.25, 0.25}));
  EXPECT_EQ(lifeline.counters().at("frames cut short"), 6u);
}

// Opened at 0 and 250 ms; story() checks that no doubt counts as a loss.
TEST_F(LifelineTest, WhatADeviceDoesOtherwiseIsPassedOnAtEveryOpening) {
  std::vector<double> exposures;
  Lifeline lifeline = started([&] {
    return std::make_unique<Asked>(
        exposures, std::vector<std::string>{"sends 5 frames per second", "has no colour"});
  });
  const std::string opening =
      " [sends 5 frames per second; has no colour]  [is gone; reopening it] ";
  EXPECT_EQ(story(lifeline, 400ms), opening + opening);
  EXPECT_EQ(lifeline.counters().at("opened"), 2u);
  EXPECT_EQ(lifeline.counters().at("lost"), 2u);
}

}  // namespace previz::lifeline_test
