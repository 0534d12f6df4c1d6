#include "daemon/core/session/replay_camera.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::replay_camera_test {

using std::chrono::milliseconds;
using namespace std::chrono_literals;
using std::chrono::nanoseconds;

class Replay : public testing::Test {
 protected:
  void SetUp() override { session::write_small_session(take(), 5); }
  std::filesystem::path take() const { return directory_ / "take"; }
  std::unique_ptr<Camera> open(const ReplayOptions& options, const char* session = "take") {
    auto camera = open_replay(directory_ / session, "observer", options, clock());
    camera->start();
    return camera;
  }
  static ReplayOptions at_speed(double speed) {
    ReplayOptions options;
    options.speed = speed;
    return options;
  }
  // Time passes only when somebody sleeps.
  HostClock clock() {
    return {[this] { return now_; }, [this](HostClock::Time time) { now_ = std::max(now_, time); }};
  }
  nanoseconds elapsed() const { return now_ - HostClock::Time{}; }

  // The next event is this frame of the take.
  static void expect_frame(Camera& camera, milliseconds timeout, int index) {
    const CameraEvent event = camera.next(timeout);
    ASSERT_TRUE(std::holds_alternative<FramePtr>(event)) << index;
    EXPECT_TRUE(session::is_frame(*std::get<FramePtr>(event), index)) << index;
  }
  static void expect_end(Camera& camera) {
    EXPECT_TRUE(std::holds_alternative<EndOfStream>(camera.next(100ms)));
  }

  test::TemporaryDirectory directory_;
  HostClock::Time now_{};
};

constexpr std::int64_t interval_ns = 40'000'003;  // of session::noise_frame

TEST_F(Replay, DeliversEveryFrameInOrderAtItsTime) {
  const auto camera = open({});
  for (int i = 0; i < 5; ++i) {
    expect_frame(*camera, 100ms, i);
    EXPECT_EQ(elapsed(), nanoseconds(i * interval_ns));
  }
  expect_end(*camera);
  expect_end(*camera);
  EXPECT_FALSE(camera->set_exposure(0.01, 1));
  EXPECT_EQ(camera->name(), (take() / "observer").string());
}

TEST_F(Replay, SpeedScalesTime) {
  const auto camera = open(at_speed(4));
  for (int i = 0; i < 5; ++i) camera->next(100ms);
  EXPECT_EQ(elapsed(), nanoseconds(interval_ns));
}

TEST_F(Replay, AShortWaitEndsWithoutAFrame) {
  const auto camera = open({});
  camera->next(0ms);
  for (int i = 1; i <= 4; ++i) {
    EXPECT_TRUE(std::holds_alternative<NoFrame>(camera->next(10ms)));
    EXPECT_EQ(elapsed(), milliseconds(10 * i));
  }
  expect_frame(*camera, 10ms, 1);
  EXPECT_EQ(elapsed(), nanoseconds(interval_ns));
}

TEST_F(Replay, ALateReaderGetsEveryFrameAtOnce) {
  const auto camera = open({});
  camera->next(0ms);
  now_ += 9s;
  for (int i = 1; i < 5; ++i) {
    expect_frame(*camera, 0ms, i);
  }
  EXPECT_EQ(elapsed(), 9s);
}

TEST_F(Replay, ARangeOfFrames) {
  ReplayOptions options;
  options.first = 1;
  options.last = 3;
  const auto camera = open(options);
  for (int i = 1; i <= 3; ++i) expect_frame(*camera, 100ms, i);
  expect_end(*camera);
  EXPECT_EQ(elapsed(), nanoseconds(2 * interval_ns));
}

// A lap is the span of its frames and one interval, so the rhythm goes on over the seam.
TEST_F(Replay, LoopsWithoutATimeJump) {
  ReplayOptions options;
  options.loop = true;
  options.first = 2;
  const auto camera = open(options);
  std::int64_t first_ns = 0;
  for (int i = 0; i < 10; ++i) {
    const FramePtr frame = std::get<FramePtr>(camera->next(100ms));
    if (i == 0) first_ns = frame->timestamp_ns;
    EXPECT_EQ(frame->bytes, session::noise_frame("", 2 + i % 3, frame->format, 24, 18).bytes);
    EXPECT_EQ(frame->timestamp_ns, first_ns + i * interval_ns);
    EXPECT_EQ(frame->sequence, 102u + i);
    EXPECT_EQ(elapsed(), nanoseconds(i * interval_ns));
  }
}

TEST_F(Replay, StreamsShareAnOrigin) {
  ReplayOptions options;
  options.origin = {now_ + 500ms,
                    session::noise_frame("", 0, PixelFormat::rgb8, 1, 1).timestamp_ns};
  const auto camera = open(options);
  EXPECT_TRUE(std::holds_alternative<NoFrame>(camera->next(499ms)));
  EXPECT_TRUE(std::holds_alternative<FramePtr>(camera->next(499ms)));
  EXPECT_EQ(elapsed(), 500ms);
}

// Whatever the recorded times are: a call waits no longer than it is asked to, frames come in the
// order they were recorded in, and the first one is there at once.
TEST_F(Replay, AbsurdTimesDoNoHarm) {
  {
    session::SessionWriter writer(directory_ / "odd", {});
    std::uint64_t sequence = 100;
    for (const std::int64_t time : {INT64_MAX, std::int64_t{0}, INT64_MIN}) {
      Frame frame = session::noise_frame("observer", 0, PixelFormat::gray8, 16, 16);
      frame.sequence = sequence++;
      frame.timestamp_ns = frame.arrival_ns = time;
      writer.write(frame);
    }
  }
  for (const double speed : {1.0, 1e-300, 1e300}) {
    ReplayOptions options = at_speed(speed);
    options.loop = true;
    const auto camera = open(options, "odd");
    std::uint64_t frames = 0;
    for (int i = 0; i < 9; ++i) {
      const nanoseconds before = elapsed();
      const CameraEvent event = camera->next(1ms);
      EXPECT_LE(elapsed() - before, 1ms) << "speed " << speed << ", call " << i;
      ASSERT_FALSE(std::holds_alternative<EndOfStream>(event)) << "it loops";
      const auto* frame = std::get_if<FramePtr>(&event);
      if (i == 0) {
        EXPECT_TRUE(frame) << "speed " << speed;
      }
      if (!frame) continue;
      EXPECT_EQ((*frame)->sequence, 100 + frames++) << "speed " << speed;
    }
  }
}

TEST_F(Replay, WhatTheSessionLacksIsToldFirst) {
  const std::string video = session::content_of(take() / "observer.mkv");
  session::write_content(take() / "observer.mkv", video.substr(0, video.size() / 2));
  const auto camera = open({});
  int troubles = 0, frames = 0;
  for (;;) {
    const CameraEvent event = camera->next(100ms);
    if (std::holds_alternative<EndOfStream>(event)) break;
    if (std::holds_alternative<DeviceTrouble>(event)) {
      EXPECT_EQ(frames, 0);
      EXPECT_EQ(std::get<DeviceTrouble>(event).device, camera->name());
      ++troubles;
    } else {
      EXPECT_TRUE(session::is_frame(*std::get<FramePtr>(event), frames++));
    }
  }
  EXPECT_EQ(troubles, 2);  // pictures missing; how many of how many are whole
  EXPECT_EQ(frames, 2);
}

// The file changes under the reader: that frame is trouble in its place, the rest goes on.
TEST_F(Replay, AnUnreadableFrameIsTroubleInItsPlace) {
  std::filesystem::remove_all(take());
  session::write_small_session(take(), 5, 200, 150);  // larger than what a reader reads ahead
  const auto camera = open(at_speed(0));
  std::string video = session::content_of(take() / "observer.mkv");
  video[video.size() / 2] ^= 1;
  session::write_content(take() / "observer.mkv", video);
  std::string seen;
  for (int i = 0; i < 5; ++i)
    seen += std::holds_alternative<FramePtr>(camera->next(0ms)) ? 'f' : 't';
  EXPECT_EQ(std::count(seen.begin(), seen.end(), 't'), 1) << seen;
  EXPECT_TRUE(std::holds_alternative<EndOfStream>(camera->next(0ms)));
}

TEST_F(Replay, SaysWhatItsPicturesAre) {
  const CameraFormat format = open({})->format();
  EXPECT_EQ(format.format, PixelFormat::rgb8);
  EXPECT_EQ(format.width, 24);
  EXPECT_EQ(format.height, 18);
  EXPECT_NEAR(format.rate_hz, 1e9 / interval_ns, 1e-6);
  EXPECT_NEAR(open(at_speed(2))->format().rate_hz, 2e9 / interval_ns, 1e-6);
}

// Frame i of the take is due at i intervals; what falls due while stopped is gone.
TEST_F(Replay, FramesWhileStoppedAreMissed) {
  const auto camera = open({});
  camera->next(100ms);
  camera->stop();
  EXPECT_TRUE(std::holds_alternative<NoFrame>(camera->next(100ms)));
  now_ += nanoseconds(2 * interval_ns + 1);
  camera->start();
  expect_frame(*camera, 100ms, 3);
  EXPECT_EQ(elapsed(), nanoseconds(3 * interval_ns));
}

TEST_F(Replay, AReopenedDeviceGoesOnWhereItIsByThen) {
  ReplayOptions options;
  options.loop = true;
  options.origin = {now_, session::noise_frame("", 0, PixelFormat::rgb8, 1, 1).timestamp_ns};
  options.position = std::make_shared<ReplayPosition>();
  open(options)->next(100ms);
  now_ += nanoseconds(1000 * 5 * interval_ns + interval_ns / 2);  // a thousand laps
  const FramePtr frame = std::get<FramePtr>(open(options)->next(100ms));
  EXPECT_EQ(frame->sequence, 100u + 5001);
  EXPECT_EQ(elapsed(), nanoseconds(5001 * interval_ns));
}

TEST_F(Replay, AtSpeedZeroNothingIsMissed) {
  ReplayOptions options = at_speed(0);
  options.position = std::make_shared<ReplayPosition>();
  for (int i = 0; i < 5; ++i) expect_frame(*open(options), 0ms, i);
  expect_end(*open(options));
  EXPECT_EQ(elapsed(), nanoseconds(0));
}

TEST_F(Replay, WrongOptionsAreErrors) {
  EXPECT_THROW(open(at_speed(-1)), Error);
  ReplayOptions options;
  options.first = 5;
  EXPECT_THROW(open(options), Error);
  EXPECT_THROW(open_replay(take(), "light"), Error);
  EXPECT_THROW(open_replay(directory_ / "nowhere", "observer"), Error);
}

}  // namespace previz::replay_camera_test
