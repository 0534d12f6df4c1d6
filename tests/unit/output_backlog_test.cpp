// How far a recording may be behind the cameras.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <mutex>

#include "daemon/output/recorder.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::output {
namespace output_backlog_test {

using session::noise_frame;
using session::TemporaryDirectory;
using test::wait_until;
using SteadyClock = RecordQueue::SteadyClock;

constexpr std::uint64_t plenty = 1'000'000'000;
constexpr double fps = 25, bound_s = 2;

// The frame of a camera that began at a time of the steady clock.
Captured frame_at(SteadyClock::time_point begin, double seconds) {
  const auto index = static_cast<std::uint64_t>(std::llround(seconds * fps));
  Captured captured{
      std::make_shared<Frame>(noise_frame("observer", index, PixelFormat::rgb8, 16, 8))};
  captured.offered = begin + std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * seconds));
  return captured;
}

TEST(RecordQueue, LeavesFramesOutRatherThanBeFurtherBehind) {
  RecordQueue queue(0, plenty, bound_s);
  queue.begin();
  const SteadyClock::time_point begin = SteadyClock::now();
  int taken = 0;
  for (int i = 0; i < 100; ++i) taken += queue.push(frame_at(begin, i / fps)) ? 1 : 0;
  EXPECT_EQ(taken, 51);  // of 0 to 2 s, both included
  EXPECT_TRUE(queue.is_too_far_behind());
  EXPECT_NEAR(queue.backlog().seconds, 99 / fps, 1e-6);
  EXPECT_EQ(queue.backlog().bytes, 51u * 16 * 8 * 3);
  // Nothing is left out any more once enough was written.
  while (queue.backlog().seconds > 1) queue.pop();
  EXPECT_TRUE(queue.push(frame_at(begin, 100 / fps)));
  EXPECT_FALSE(queue.is_too_far_behind());
}

TEST(RecordQueue, IsNotBehindWhatWasWritten) {
  RecordQueue queue(0, plenty, bound_s);
  queue.begin();
  const SteadyClock::time_point begin = SteadyClock::now();
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(queue.push(frame_at(begin, i / fps)));
    while (!queue.empty()) queue.pop();
    EXPECT_EQ(queue.backlog().seconds, 0);
    EXPECT_EQ(queue.backlog().bytes, 0u);
  }
}

// What the ring held when the take began is beside the bound at first, and a part of it after ten
// seconds. Here each second two thirds of what comes is written: one third, 3.3 s, more are behind
// after ten.
TEST(RecordQueue, GivesThePreRollTenSeconds) {
  constexpr double ring_s = 4;
  RecordQueue queue(ring_s, plenty, bound_s);
  const SteadyClock::time_point begin = SteadyClock::now();
  int i = 0;
  for (; i <= ring_s * fps; ++i) queue.keep(frame_at(begin, i / fps));
  queue.begin();
  EXPECT_NEAR(queue.backlog().seconds, ring_s, 1 / fps + 1e-6);  // by the frames' own times
  EXPECT_NEAR(queue.backlog().of_ring_s, ring_s, 1 / fps + 1e-6);
  double first_loss_s = 0;
  for (; i < (ring_s + 15) * fps; ++i) {
    const double since_s = i / fps - ring_s;
    if (!queue.push(frame_at(begin, i / fps)) && first_loss_s == 0) first_loss_s = since_s;
    if (i % 3 != 0) queue.pop();
  }
  // 4 + t/3 of backlog meet 2 + 4 (1 - t/10) of allowance: t = 2 / (1/3 + 4/10).
  EXPECT_NEAR(first_loss_s, 2.73, 0.1);
  const Backlog late = queue.backlog();
  EXPECT_EQ(late.of_ring_s, 0);
  EXPECT_LE(late.seconds, bound_s + 2 / fps) << "after the grace the bound is the whole";
}

// The recorder counts what it leaves out, in the take as well, and says why.
TEST(Recorder, SaysHowFarItIsBehindAndWhatItLeavesOut) {
  const TemporaryDirectory directory;
  std::mutex disk, notes_mutex;
  std::vector<std::string> notes;
  RecorderOptions options;
  options.take.folders = {directory / "takes"};
  options.take.info.take = session::TakeInfo{0, "12A", "", 25, "", false};
  options.preroll_s = 0;
  options.most_behind_s = 0.3;
  options.queue_bytes = plenty;
  options.reserve_bytes = 0;
  options.free_bytes = [&](const auto&) {  // the writer asks the disk once a second
    const std::lock_guard lock(disk);
    return plenty;
  };
  options.note = [&](const report::Report& report) {
    const std::lock_guard lock(notes_mutex);
    notes.push_back(report.text);
  };
  Recorder recorder(std::move(options));
  std::uint64_t offered = 0;
  const auto offer = [&] {
    recorder.offer(
        std::make_shared<Frame>(noise_frame("observer", offered++, PixelFormat::rgb8, 16, 8)));
  };
  recorder.start();
  offer();
  ASSERT_TRUE(wait_until("the take is begun", [&] { return recorder.status().frames == 1; }));
  disk.lock();
  ASSERT_TRUE(wait_until("frames are left out", [&] {
    offer();
    return recorder.status().lost.frames > 3;
  }));
  EXPECT_GT(recorder.status().backlog.seconds, 0.3);
  EXPECT_GT(recorder.status().backlog.bytes, 0u);
  disk.unlock();
  recorder.stop();
  recorder.finish();
  EXPECT_EQ(recorder.status().backlog.seconds, 0);
  session::Session session = session::open_session(directory / "takes/12A_take001");
  const auto stream = session::open_stream(session, "observer");
  EXPECT_EQ(stream->records().size() + recorder.status().lost.frames, offered);
  EXPECT_TRUE(session::mentions(session.missing, "frames of the cameras did not reach the disk"));
  EXPECT_THAT(notes, testing::Contains(testing::HasSubstr("recording.most_behind_s")));
}

}  // namespace output_backlog_test
}  // namespace previz::output
