// How far a recording may be behind the cameras.
#include "tests/support/recorder_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::output::backlog_test {

using session::noise_frame;
using session::TemporaryDirectory;
using test::wait_until;
using SteadyClock = RecordQueue::SteadyClock;

constexpr double fps = 25, bound_s = 2;

// The frame of a camera that began at a time of the steady clock.
Captured frame_at(SteadyClock::time_point begin, double seconds) {
  const auto index = static_cast<std::uint64_t>(std::llround(seconds * fps));
  Captured captured{
      std::make_shared<Frame>(noise_frame("observer", index, PixelFormat::rgb8, 16, 8))};
  captured.offered = begin + std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * seconds));
  return captured;
}

std::uint64_t sequence_of(const RecordQueue::Queued& queued) {
  const auto* captured = std::get_if<Captured>(&queued.entry);
  return captured ? captured->frame->sequence : 0;
}

// The oldest frame goes where one waits too long, and the one that is next says so.
TEST(RecordQueue, LeavesFramesOutRatherThanBeFurtherBehind) {
  RecordQueue queue(0, plenty, bound_s);
  queue.begin();
  queue.pop();
  const SteadyClock::time_point begin = SteadyClock::now();
  std::uint64_t lost = 0;
  for (int i = 0; i < 100; ++i) {
    const LeftOut left_out = queue.push(frame_at(begin, i / fps));
    EXPECT_EQ(left_out.is_too_far_behind, left_out.any());
    EXPECT_EQ(left_out.of_older, session::Losses{});
    lost += left_out.of_newest.frames;
  }
  EXPECT_EQ(lost, 49u);  // beside 2 s, both ends included
  EXPECT_NEAR(queue.backlog().seconds, bound_s, 1e-6);
  EXPECT_EQ(queue.backlog().bytes, 51u * 16 * 8 * 3);
  const RecordQueue::Queued first = queue.pop();
  EXPECT_EQ(sequence_of(first), frame_at(begin, 49 / fps).frame->sequence);
  EXPECT_EQ(first.lost.frames, lost);
  EXPECT_FALSE(queue.push(frame_at(begin, 100 / fps)).any());
}

// A loss of a take that has ended does not count for the take that has begun meanwhile.
TEST(RecordQueue, SaysOfWhichTakeItLeavesFramesOut) {
  RecordQueue queue(0, plenty, bound_s);
  const SteadyClock::time_point begin = SteadyClock::now();
  queue.begin();
  for (int i = 0; i < 50; ++i) queue.push(frame_at(begin, i / fps));
  queue.push_mark(RecordQueue::Stop{});
  queue.begin();
  LeftOut all;
  for (int i = 50; i < 150; ++i) {
    const LeftOut left_out = queue.push(frame_at(begin, i / fps));
    add(all.of_older, left_out.of_older);
    add(all.of_newest, left_out.of_newest);
  }
  EXPECT_EQ(all.of_older.frames, 50u);
  EXPECT_EQ(all.of_newest.frames, 49u);
  queue.pop();                              // the first take's start
  EXPECT_EQ(queue.pop().lost.frames, 50u);  // its stop
  EXPECT_EQ(queue.pop().lost.frames, 0u);   // the second take's start
  EXPECT_EQ(queue.pop().lost.frames, 49u);
}

// Every fourth frame is kept where the encoder takes four times as long as there is.
TEST(RecordQueue, OfAnEncoderThatIsTooSlowLeavesFramesOutEvenly) {
  RecordQueue queue(0, plenty, bound_s);
  queue.begin();
  queue.pop();  // the take's start
  const SteadyClock::time_point begin = SteadyClock::now();
  constexpr int a_picture = 4;
  std::vector<std::uint64_t> written;
  for (int i = 0; i < 60 * fps; ++i) {
    queue.push(frame_at(begin, i / fps));
    EXPECT_LE(queue.backlog().seconds, bound_s + 1e-6);
    if (i % a_picture == 0) written.push_back(sequence_of(queue.pop()));
  }
  // After the first two seconds, of which all were queued; times are whole nanoseconds.
  for (std::size_t i = static_cast<std::size_t>(bound_s * fps) + 1; i < written.size(); ++i)
    EXPECT_NEAR(static_cast<double>(written[i] - written[i - 1]), a_picture, 1) << i;
}

// A disk that stands still for less than the bound and is fast otherwise loses nothing.
TEST(RecordQueue, OfADiskThatStandsStillNowAndThenLosesNothing) {
  RecordQueue queue(0, plenty, bound_s);
  queue.begin();
  const SteadyClock::time_point begin = SteadyClock::now();
  constexpr double still_s = 1.8, interval_s = 6;
  for (int i = 0; i < 60 * fps; ++i) {
    const Captured captured = frame_at(begin, i / fps);
    ASSERT_FALSE(queue.push(captured).any()) << "frame " << i;
    if (std::fmod(i / fps, interval_s) < still_s) continue;
    for (int k = 0; k < 3 && !queue.empty(); ++k) queue.pop();
  }
}

// Pictures that were shown, which are worth less, are left out first.
TEST(RecordQueue, LeavesShownPicturesOutAtHalfTheBound) {
  RecordQueue queue(0, plenty, bound_s);
  queue.begin();
  const SteadyClock::time_point begin = SteadyClock::now();
  for (int i = 0; i <= bound_s * fps; ++i) {
    ASSERT_FALSE(queue.push(frame_at(begin, i / fps)).any());
    Captured shown = frame_at(begin, i / fps);
    auto composite = std::make_shared<Frame>(*shown.frame);
    composite->source = "composite";
    shown.frame = composite;
    const LeftOut left_out = queue.push_shown(shown);
    EXPECT_EQ(left_out.of_newest.shown, i / fps <= bound_s / 2 ? 0 : 1) << i;
    EXPECT_EQ(left_out.is_too_far_behind, left_out.any());
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
    if (queue.push(frame_at(begin, i / fps)).any() && first_loss_s == 0) first_loss_s = since_s;
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
  std::mutex disk;
  Heard heard;
  RecorderOptions options = recorder_options({directory / "takes"});
  options.most_behind_s = 0.3;
  options.queue_bytes = plenty;
  options.reserve_bytes = 0;
  options.free_bytes = [&](const auto&) {  // the writer asks the disk once a second
    const std::lock_guard lock(disk);
    return plenty;
  };
  heard.listen(options);
  Recorder recorder(std::move(options));
  std::uint64_t offered = 0;
  const auto offer = [&] {
    recorder.offer(
        std::make_shared<Frame>(noise_frame("observer", offered++, PixelFormat::rgb8, 16, 8)));
  };
  recorder.start();
  offer();
  ASSERT_TRUE(wait_for_frames(recorder, 1));
  disk.lock();
  ASSERT_TRUE(wait_until("frames are dropped", [&] {
    offer();
    return recorder.status().lost.frames > 3;
  }));
  EXPECT_GT(recorder.status().backlog.seconds, 0);
  EXPECT_LE(recorder.status().backlog.seconds, 0.3);
  EXPECT_GT(recorder.status().backlog.bytes, 0u);
  disk.unlock();
  end_take(recorder);
  EXPECT_EQ(recorder.status().backlog.seconds, 0);
  EXPECT_EQ(recorder.status().backlog.bytes, 0u);
  session::Session session = session::open_session(directory / "takes/12A_take001");
  const auto stream = session::open_stream(session, "observer");
  EXPECT_EQ(stream->records().size() + recorder.status().lost.frames, offered);
  EXPECT_TRUE(session::mentions(session.missing, "camera frames did not reach the disk"));
  EXPECT_TRUE(heard.said("recording.most_behind_s"));
  EXPECT_EQ(heard.left_out(), (Causes{{"too far behind", recorder.status().lost.frames}}));
}

}  // namespace previz::output::backlog_test
