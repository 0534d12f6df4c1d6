// Takes: every frame is in them or counted, whatever happens to process and disk.
#include "daemon/core/output/recorder.hpp"

#include "drivers/bracket.hpp"
#include "tests/support/child_process.hpp"
#include "tests/support/full_disk.hpp"
#include "tests/support/recorder_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::output::recorder_test {

using session::mentions;
using session::noise_frame;
using session::TemporaryDirectory;
using test::wait_until;

constexpr std::int64_t interval_ns = 40'000'003;  // of noise_frame

RecorderOptions options_in(const std::filesystem::path& directory) {
  RecorderOptions options = recorder_options({directory});
  options.take.info.take->notes = "rain";
  options.reserve_bytes = 0;
  return options;
}

// Whoever takes the disk out after "recording ended" must be able to see that the take is whole.
TEST(Recorder, SaysForHowLongATakeIsBeingWritten) {
  const TemporaryDirectory directory;
  Recorder recorder(options_in(directory.path()));
  EXPECT_TRUE(wait_until("nothing is written", [&] { return !recorder.status().writing; }));
  recorder.start();
  for (std::uint64_t i = 0; i < 40; ++i) recorder.offer(picture(i));
  EXPECT_TRUE(recorder.status().writing);
  recorder.stop();
  // The disk has not taken the queue, and no track of the frames has come: they are waited for.
  EXPECT_FALSE(recorder.status().recording);
  EXPECT_TRUE(recorder.status().writing);
  EXPECT_TRUE(wait_until("the take is whole", [&] { return !recorder.status().writing; }));
  const RecorderStatus status = recorder.status();
  EXPECT_EQ(status.finished_takes, 1u);
  EXPECT_THAT(missing_of(status.directory), IsEmpty());
}

TEST(Timecode, CountsFramesOfTheNearestWholeRate) {
  using namespace std::chrono_literals;
  EXPECT_EQ(timecode(0s, 25), "00:00:00:00");
  EXPECT_EQ(timecode(14h + 3min + 27s + 480ms, 25), "14:03:27:12");
  EXPECT_EQ(timecode(23h + 59min + 59s + 999ms, 25), "23:59:59:24");
  EXPECT_EQ(timecode(1s + 999ms, 23.976), "00:00:01:23");
}

TEST(TakeName, IsWhatAFileSystemCanHold) {
  EXPECT_EQ(take_name("12A", 7), "12A_take007");
  EXPECT_EQ(take_name("attic, sc. 3/4", 1234), "attic__sc._3_4_take1234");
  EXPECT_EQ(take_name("", 1), "__take001");
  EXPECT_EQ(take_name("../x", 1), "_.._x_take001");
}

TEST(Recorder, ATakeHasEveryFrameFromStartToStopWithItsTrack) {
  const TemporaryDirectory directory;
  {
    Recorder recorder(options_in(directory.path()));
    for (int i = 0; i < 12; ++i) {
      if (i == 3) recorder.start();
      if (i == 9) recorder.stop();
      recorder.offer(picture(i));
      recorder.offer(track_of(i));
    }
    recorder.offer_event(17, "is of no take");
  }
  const std::filesystem::path take = directory / "12A_take001";
  // The ring of no seconds still holds the newest frame: frame 2 was there when it started.
  EXPECT_EQ(frames_of(take), count_from(2, 8));
  const session::Session session = session::open_session(take);
  EXPECT_TRUE(session.missing.empty());
  EXPECT_EQ(session.info.name, "12A_take001");
  EXPECT_EQ(session.info.take->number, 1);
  EXPECT_EQ(session.info.take->notes, "rain");
  EXPECT_EQ(session.info.take->timecode.size(), std::string("14:03:27:12").size());
  ASSERT_EQ(session.track.size(), 7u);
  for (std::size_t i = 0; i < 7; ++i) {
    EXPECT_EQ(session.track[i].frame, i);
    EXPECT_EQ(session.track[i].world_from_camera[3][0], static_cast<double>(i + 2));
  }
  EXPECT_FALSE(std::filesystem::exists(take / "events.jsonl"));
}

TEST(Recorder, TheRingPutsWhatCameBeforeInFrontWithItsLight) {
  const TemporaryDirectory directory;
  {
    RecorderOptions options = options_in(directory.path());
    options.preroll_s = 5e-9 * interval_ns;
    Recorder recorder(std::move(options));
    for (const std::uint64_t light : {0, 1, 2}) recorder.offer(picture(light, "light"));
    for (int i = 3; i <= 20; ++i) recorder.offer(picture(i));
    recorder.start();
    recorder.offer(picture(21));
  }
  const std::filesystem::path take = directory / "12A_take001";
  EXPECT_EQ(frames_of(take), count_from(15, 21));
  EXPECT_EQ(frames_of(take, "light"), count_from(0, 2));  // older than the ring, and still needed
}

// In standby nothing is offered: what is in the ring then is no pre-roll.
TEST(Recorder, WhatTheRingHasFromLongAgoIsNotInFront) {
  const TemporaryDirectory directory;
  {
    RecorderOptions options = options_in(directory.path());
    options.preroll_s = 0.04;
    Recorder recorder(std::move(options));
    recorder.offer(picture(0, "light"));
    recorder.offer(picture(1));
    // Longer than the pre-roll and the second that a captured frame may be late.
    std::this_thread::sleep_for(std::chrono::milliseconds(1100));
    recorder.start();
    recorder.offer(picture(2));
  }
  EXPECT_EQ(frames_of(directory / "12A_take001"), count_from(2, 2));
  EXPECT_EQ(frames_of(directory / "12A_take001", "light"), count_from(0, 0));
}

// An automatic exposure that wanders, and a light camera that came back with another format.
TEST(Recorder, OfLightFromBeforeTheTakeTheNewestExposuresOfOneFormatAreInIt) {
  const TemporaryDirectory directory;
  constexpr std::uint64_t last = 40;
  {
    RecorderOptions options = options_in(directory.path());
    options.preroll_s = 1e-9;
    Recorder recorder(std::move(options));
    recorder.offer(picture(0, "light", 40));
    for (std::uint64_t i = 1; i <= last; ++i) recorder.offer(picture(i, "light"));
    recorder.start();
    recorder.offer(picture(last + 1));
  }
  EXPECT_EQ(frames_of(directory / "12A_take001", "light"),
            count_from(last - most_exposures, last));  // one of them is in the ring
  EXPECT_EQ(frames_of(directory / "12A_take001"), count_from(last + 1, last + 1));
  EXPECT_FALSE(std::filesystem::exists(directory / "12A_take002"));
}

TEST(Recorder, TellsTheTimeOfATakeAndTheRoomThatIsLeft) {
  const TemporaryDirectory directory;
  std::atomic<std::uint64_t> free = 700;
  RecorderOptions options = options_in(directory / "not/made/yet");
  options.reserve_bytes = 200;
  const auto has_room = [](const Recorder& recorder, std::uint64_t bytes) {
    return wait_until("the room is known", [&] { return recorder.free_bytes() == bytes; });
  };
  {
    const Recorder recorder(options);  // of the disk it will be made on
    EXPECT_TRUE(wait_until("it is known", [&] { return recorder.free_bytes().value_or(0) > 0; }));
  }
  options.free_bytes = [&](const auto&) { return free.load(); };
  Recorder recorder(std::move(options));
  EXPECT_TRUE(has_room(recorder, 500));
  free = 100;
  EXPECT_TRUE(has_room(recorder, 0));
  free = 700;
  recorder.start();
  for (const std::uint64_t i : {10, 11, 12, 13}) recorder.offer(picture(i));
  recorder.offer(picture(20, "light"));
  recorder.offer(picture(14));
  ASSERT_TRUE(wait_for_frames(recorder, 5));
  EXPECT_DOUBLE_EQ(recorder.status().seconds, 4e-9 * interval_ns);
}

TEST(Recorder, TheNextTakeHasTheLightThatWasSeenDuringTheLast) {
  const TemporaryDirectory directory;
  {
    Recorder recorder(options_in(directory.path()));
    recorder.start();
    recorder.offer(picture(0, "light"));
    recorder.offer(picture(1));
    recorder.stop();
    recorder.start();
    recorder.offer(picture(2));
  }
  EXPECT_EQ(frames_of(directory / "12A_take002", "light"), count_from(0, 0));
  EXPECT_EQ(frames_of(directory / "12A_take002"), count_from(2, 2));
}

TEST(Recorder, TheTrackOfTheLastFrameMayComeAfterTheButton) {
  const TemporaryDirectory directory;
  {
    Recorder recorder(options_in(directory.path()));
    record_take(recorder);
    recorder.offer(picture(1));
    recorder.offer(track_of(0));
    recorder.offer(track_of(1));
  }
  EXPECT_EQ(session::open_session(directory / "12A_take001").track.size(), 1u);
}

TEST(Recorder, MarksTheRunningTakeOrTheLast) {
  const TemporaryDirectory directory;
  {
    Recorder recorder(options_in(directory.path()));
    recorder.start();
    recorder.offer(picture(0));
    recorder.mark_good();
    recorder.stop();
    record_take(recorder, 1);
    recorder.mark_good();
  }
  EXPECT_TRUE(session::open_session(directory / "12A_take001").info.take->good);
  EXPECT_TRUE(session::open_session(directory / "12A_take002").info.take->good);
}

TEST(Recorder, MarksTheTakeOfAnEarlierRecorder) {
  const TemporaryDirectory directory, other;
  {
    Recorder recorder(options_in(directory.path()));
    record_take(recorder);
  }
  RecorderOptions options = options_in(other.path());
  options.last_take = directory / "12A_take001";
  {
    Recorder recorder(options);
    EXPECT_FALSE(recorder.status().ending);
    recorder.mark_good();
    EXPECT_TRUE(test::wait_until("it is marked", [&] { return recorder.status().good; }));
    EXPECT_EQ(recorder.status().directory, options.last_take);
  }
  EXPECT_TRUE(session::open_session(options.last_take).info.take->good);
}

TEST(Recorder, ATakeEndsUntilItIsWhole) {
  const TemporaryDirectory directory;
  Recorder recorder(options_in(directory.path()));
  EXPECT_FALSE(recorder.status().ending);
  recorder.start();
  recorder.offer(picture(0));
  EXPECT_FALSE(recorder.status().ending);
  recorder.stop();
  EXPECT_TRUE(recorder.status().ending);  // the tracking of its frame is waited for
  EXPECT_TRUE(test::wait_until("it is whole", [&] { return !recorder.status().ending; }));
  EXPECT_EQ(recorder.status().finished, "12A_take001");
}

FramePtr mosaic(std::uint64_t index, BayerPattern bayer) {
  auto frame = std::make_shared<Frame>(noise_frame("observer", index, PixelFormat::gray8, 32, 24));
  frame->bayer = bayer;
  return frame;
}

TEST(Recorder, AnotherSizeOrBayerPatternBeginsTheNextTake) {
  for (const auto& [one, other] :
       {std::pair(picture(0), picture(1, "observer", 40)),
        std::pair(mosaic(0, BayerPattern::rggb), mosaic(1, BayerPattern::none))}) {
    const TemporaryDirectory directory;
    Recorder recorder(options_in(directory.path()));
    recorder.start();
    recorder.offer(one);
    recorder.offer(other);
    ASSERT_TRUE(wait_until("the second take has a frame", [&] {
      return recorder.status().frames == 1 && recorder.status().number == 2;
    }));
    EXPECT_EQ(recorder.status().failures, 0u);
    end_take(recorder);
    EXPECT_EQ(frames_of(directory / "12A_take001"), count_from(0, 0));
    EXPECT_EQ(frames_of(directory / "12A_take002"), count_from(1, 1));
  }
}

// Room for three frames: what the disk cannot take in time is counted, and the rest is whole.
TEST(Recorder, ASlowDiskCostsFramesThatAreCounted) {
  const TemporaryDirectory directory;
  RecorderOptions options = options_in(directory.path());
  options.queue_bytes = 3 * picture(0)->bytes.size();
  Heard heard;
  heard.listen(options);
  constexpr std::uint64_t offered = 400;
  std::vector<FramePtr> pictures;
  for (std::uint64_t i = 0; i < offered; ++i) pictures.push_back(picture(i));
  RecorderStatus status;
  {
    Recorder recorder(std::move(options));
    recorder.start();
    for (const FramePtr& frame : pictures) recorder.offer(frame);
    recorder.stop();
    ASSERT_TRUE(wait_for_finished(recorder, 1));
    status = recorder.status();
  }
  EXPECT_EQ(frames_of(directory / "12A_take001").size(), status.frames);
  EXPECT_EQ(status.frames + status.lost.frames, offered);
  EXPECT_GT(status.lost.frames, 0u);
  EXPECT_TRUE(heard.said("too slow"));
  EXPECT_EQ(heard.left_out(), (Causes{{"memory full", status.lost.frames}}));
  EXPECT_EQ(status.failures, 0u);
}

TEST(Recorder, AnAlmostFullDiskEndsTheTakeInOrder) {
  const TemporaryDirectory directory;
  RecorderOptions options = options_in(directory.path());
  options.reserve_bytes = 100;
  std::atomic<std::uint64_t> free = 1000;
  options.free_bytes = [&](const auto&) { return free.load(); };
  Recorder recorder(std::move(options));
  recorder.start();
  std::uint64_t next = 0;
  for (; next < 5; ++next) recorder.offer(picture(next));
  ASSERT_TRUE(wait_for_frames(recorder, 5));
  free = 50;
  ASSERT_TRUE(wait_until("the take has ended", [&] {
    recorder.offer(picture(next++));
    return !recorder.status().recording;
  }));
  const RecorderStatus status = recorder.status();
  EXPECT_THAT(status.fault, HasSubstr("almost full"));
  EXPECT_EQ(status.failures, 1u);
  EXPECT_EQ(status.finished_takes, 1u);
  EXPECT_THAT(missing_of(directory / "12A_take001"), IsEmpty());  // closed
  EXPECT_EQ(frames_of(directory / "12A_take001"), count_from(0, status.frames - 1));

  recorder.start();  // refused by the same disk
  ASSERT_TRUE(wait_for_failures(recorder, 2));
  EXPECT_THAT(recorder.status().fault,
              HasSubstr(directory.path().string() + ": the disk is almost"));
  EXPECT_FALSE(recorder.status().recording);
  free = 1000;
  recorder.start();
  recorder.offer(picture(next));
  ASSERT_TRUE(wait_until("a frame is written", [&] { return recorder.status().frames > 0; }));
  EXPECT_TRUE(recorder.status().fault.empty());
}

// Until the take has ended by itself, which it does within the frames that the disk can hold.
void record_until_the_disk_is_full(Recorder& recorder, std::uint64_t& next) {
  recorder.start();
  ASSERT_TRUE(wait_until("the take has ended", [&] {
    recorder.offer(picture(next));
    recorder.offer(track_of(next++));
    return !recorder.status().recording;
  }));
}

TEST(Recorder, AFileThatCannotGrowEndsTheTakeWithEverythingSoFarReadable) {
  const TemporaryDirectory directory;
  Heard heard;
  RecorderOptions options = options_in(directory.path());
  heard.listen(options);
  Recorder recorder(std::move(options));
  std::uint64_t next = 0;
  {
    const test::FileSizeLimit limit(60'000);  // about 25 frames of noise
    ASSERT_NO_FATAL_FAILURE(record_until_the_disk_is_full(recorder, next));
  }
  const RecorderStatus status = recorder.status();
  EXPECT_THAT(status.fault, HasSubstr("12A_take001"));
  EXPECT_GT(status.frames, 10u);
  EXPECT_EQ(frames_of(directory / "12A_take001"), count_from(0, status.frames - 1));
  EXPECT_EQ(heard.left_out(), (Causes{{"disk failed", status.lost.frames}}));
  recorder.start();  // and it goes on when there is room again
  recorder.offer(picture(next));
  recorder.stop();
  ASSERT_TRUE(wait_for_finished(recorder, 2));
  // With the frame the ring held.
  EXPECT_EQ(frames_of(directory / "12A_take002").back(), next);
}

// A disk of 128 kB without a byte in reserve, in a process that has it for itself. A frame of noise
// has 2304 bytes; with its lines and the file system's pages it takes less than twice that, so that
// at least 28 fit.
TEST(Recorder, AFullDiskEndsTheTakeWithEverythingSoFarReadable) {
#ifdef __SANITIZE_THREAD__
  GTEST_SKIP() << "ThreadSanitizer confuses the threads of a child with those it was forked beside";
#endif
  const TemporaryDirectory directory;
  constexpr int may_not_mount = 77;
  std::fflush(nullptr);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    if (!test::mount_small_disk(directory.path(), "128k")) _exit(may_not_mount);
    [&] {
      std::uint64_t next = 0;
      Recorder recorder(options_in(directory.path()));
      ASSERT_NO_FATAL_FAILURE(record_until_the_disk_is_full(recorder, next));
      const RecorderStatus status = recorder.status();
      EXPECT_THAT(status.fault, HasSubstr("No space left on device"));
      EXPECT_GE(status.frames, 28u);
      EXPECT_EQ(frames_of(directory / "12A_take001"), count_from(0, status.frames - 1));
    }();
    std::fflush(nullptr);
    _exit(testing::Test::HasFailure() ? 1 : 0);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  if (WEXITSTATUS(status) == may_not_mount)
    GTEST_SKIP() << "this process may not mount a file system of its own";
  EXPECT_EQ(WEXITSTATUS(status), 0) << "see the failures of the process that had the disk, above";
}

// kill -9 at 25 frames a second. A frame that is counted as written is the kernel's, which outlives
// the process: it is there without exception. Of those that were only offered at most a second's
// are not. This says nothing of a power cut, which also takes what the kernel had not yet written.
TEST(RecorderDeath, AKilledProcessKeepsEveryFrameThatItCounted) {
  const TemporaryDirectory directory;
  struct Report {
    std::uint64_t offered = 0, counted = 0;
  };
  test::ChildProcess recording([&](int tells) {
    Recorder recorder(options_in(directory.path()));
    recorder.start();
    for (std::uint64_t i = 0;; ++i) {
      recorder.offer(picture(i));
      recorder.offer(track_of(i));
      test::tell(tells, Report{i, recorder.status().frames});
      std::this_thread::sleep_for(std::chrono::nanoseconds(interval_ns));
    }
  });
  Report report;
  while (report.offered < 40) ASSERT_TRUE(recording.is_told(report));
  recording.kill();
  while (recording.is_told(report)) continue;

  const std::vector<std::uint64_t> there = frames_of(directory / "12A_take001");
  ASSERT_FALSE(there.empty());
  EXPECT_EQ(there, count_from(0, there.back()));
  EXPECT_GT(report.counted, 0u);
  EXPECT_GE(there.size(), report.counted);
  EXPECT_GE(there.back() + 25, report.offered);
  EXPECT_TRUE(mentions(missing_of(directory / "12A_take001"), "not closed"));

  // The next process knows that it was recording, and brings the take into order.
  {
    Recorder recorder(options_in(directory.path()));
    ASSERT_TRUE(
        wait_until("it is known", [&] { return recorder.status().interrupted.has_value(); }));
    const RecorderStatus status = recorder.status();
    EXPECT_EQ(status.interrupted, "12A_take001");
    ASSERT_EQ(status.salvaged.size(), 1u);
    EXPECT_EQ(status.salvaged[0],
              "12A_take001 was cut off; it has " + std::to_string(there.size()) + " frames");
    recorder.start();
    recorder.offer(picture(0));
  }
  EXPECT_TRUE(mentions(missing_of(directory / "12A_take001"), "was cut off"));
  EXPECT_EQ(frames_of(directory / "12A_take001"), there);
  EXPECT_EQ(frames_of(directory / "12A_take002"), count_from(0, 0));
}

// Returns the take that the recorder of a new process finds cut off, if any.
std::optional<std::string> interrupted_in(const std::filesystem::path& directory) {
  const Recorder recorder(options_in(directory));
  EXPECT_TRUE(wait_for_its_look(recorder));
  EXPECT_THAT(recorder.status().salvaged, IsEmpty());
  return recorder.status().interrupted;
}

TEST(Recorder, RemembersThatItWasRecordingUntilSomebodyEndsIt) {
  const TemporaryDirectory directory;
  EXPECT_EQ(interrupted_in(directory.path()), std::nullopt);
  {
    Recorder recorder(options_in(directory.path()));
    recorder.start();
    recorder.offer(picture(0));
  }  // as for an upgrade: the take is closed, and nobody has ended the recording
  EXPECT_THAT(missing_of(directory / "12A_take001"), IsEmpty());
  EXPECT_EQ(interrupted_in(directory.path()), "12A_take001");
  {
    Recorder recorder(options_in(directory.path()));
    record_take(recorder);
  }
  EXPECT_EQ(interrupted_in(directory.path()), std::nullopt);
}

// The rig finishes its recorder before it gives back its devices, which still deliver.
TEST(Recorder, HasEverythingOnTheDiskOnceItIsFinishedAndTakesNothingAfterThat) {
  const TemporaryDirectory directory;
  Recorder recorder(options_in(directory.path()));
  recorder.start();
  for (int i = 0; i < 3; ++i) recorder.offer(picture(i));
  recorder.finish();
  const std::filesystem::path take = directory / "12A_take001";
  EXPECT_THAT(missing_of(take), IsEmpty());
  recorder.offer(picture(3));
  recorder.offer(track_of(3));
  recorder.finish();
  EXPECT_EQ(frames_of(take), count_from(0, 2));
  EXPECT_FALSE(recorder.status().recording);
}

// A disk that hangs: it is reported, what waits is bounded in bytes, whatever it is, and what is
// left out is counted in the take.
TEST(Recorder, OfADiskThatHangsKeepsAQueueOfBoundedSizeAndSaysSo) {
  const TemporaryDirectory directory;
  std::mutex hangs;
  std::atomic<int> silences = 0;
  RecorderOptions options = options_in(directory.path());
  options.queue_bytes = 100'000;
  options.free_bytes = [&](const auto&) {  // the writer asks the disk once a second
    const std::lock_guard lock(hangs);
    return std::uint64_t{1'000'000'000};
  };
  options.note = [&](const report::Report& report) {
    silences += report.text.find("does not respond") != std::string::npos;
  };
  session::TrackRecord with_light = track_of(0);
  with_light.captured_light.emplace();
  with_light.captured_light->ambient.resize(4096);  // 49 KB
  session::Losses lost;
  {
    Recorder recorder(std::move(options));
    ASSERT_TRUE(begin_take(recorder));
    hangs.lock();
    for (std::uint64_t i = 1; recorder.status().disk_silent_s < 2.5; ++i) {
      recorder.offer(picture(i));
      recorder.offer(with_light);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));  // as a camera at 50 Hz offers
    }
    hangs.unlock();
    lost = recorder.status().lost;
    // 100 kB hold 43 pictures of 32x24x3 bytes, and with an eighth more two records.
    EXPECT_GT(lost.frames, 0u);
    EXPECT_GT(lost.records, 50u);
    EXPECT_EQ(silences, 1);
    recorder.stop();
  }
  const session::Session session = session::open_session(directory / "12A_take001");
  for (const std::string& words : session::words_of(lost))
    EXPECT_TRUE(mentions(session.missing, words)) << words;
}

}  // namespace previz::output::recorder_test
