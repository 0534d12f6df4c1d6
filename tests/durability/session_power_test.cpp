// Sessions on disks that lose power and that fail: what was acknowledged is there, and nothing is
// taken for whole that is not.
#include "daemon/core/output/asset_store.hpp"
#include "daemon/core/session/files.hpp"
#include "tests/durability/faulty_rounds.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/recorder_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::output::session_power_test {

using session::is_frame;
using session::noise_frame;
using session::SessionWriter;
using session::write_content;
using test::AfterPowerCut;
using test::DiskFault;
using test::FaultyDisk;
using test::TemporaryDirectory;
using test::wait_until;

constexpr int frames = 4;

// Writes a session with two streams, a track, an event and an asset. `done` is called after each
// frame of the observer and, with `frames`, once more after closing.
void write_session(const std::filesystem::path& directory, const std::filesystem::path& asset,
                   const std::function<void(int)>& done) {
  SessionWriter writer(directory, {}, std::chrono::nanoseconds(0));
  writer.add_asset("a.glb", asset);
  for (int i = 0; i < frames; ++i) {
    writer.write(noise_frame("observer", i, PixelFormat::rgb8, 24, 18));
    done(i);
    writer.write(noise_frame("light", i, PixelFormat::rgb8, 16, 16));
    session::TrackRecord track = track_of(i);
    track.frame = static_cast<std::uint64_t>(i);
    writer.write(track);
    writer.write_event(i, "something happened");
  }
  writer.close();
  done(frames);
}

// Returns how many frames of the observer can be read, each compared bit for bit with those from
// `first` on; nothing where there is no session.
std::optional<int> frames_in(const std::filesystem::path& directory, bool& closed, int first = 0) {
  if (!std::filesystem::exists(directory / "session.toml")) return std::nullopt;
  session::Session session = session::open_session(directory);
  const auto stream = session::open_stream(session, "observer");
  closed = session.missing.empty();
  if (!stream) return 0;
  for (std::size_t i = 0; i < stream->records().size(); ++i)
    EXPECT_TRUE(is_frame(*stream->read(i), first + i)) << i;
  return static_cast<int>(stream->records().size());
}

// Every frame whose write() had returned is there, whatever the disk keeps of the rest: all is
// synced by every call here, and about once a second on a rig.
TEST(PowerCut, LosesNoFrameThatWasAcknowledged) {
  const TemporaryDirectory folder, elsewhere;
  write_content(elsewhere / "asset.glb", "a model");
  FaultyDisk disk(folder.path());
  std::vector<std::size_t> acknowledged;  // calls when frame i was, and when the session was closed
  write_session(folder / "takes" / "one", elsewhere / "asset.glb",
                [&](int) { acknowledged.push_back(disk.calls()); });
  ASSERT_GT(disk.calls(), 50u);
  for_each_power_cut(disk, 0, elsewhere / "after", [&](std::size_t cut) {
    const auto promised = static_cast<int>(
        std::ranges::count_if(acknowledged, [&](std::size_t calls) { return calls <= cut; }));
    bool closed = false;
    const std::optional<int> there = frames_in(elsewhere / "after" / "takes" / "one", closed);
    EXPECT_GE(there.value_or(0), std::min(promised, frames));
    EXPECT_TRUE(!closed || there == frames) << "closed, and something is missing";
    EXPECT_TRUE(closed || promised <= frames) << "it was said to be closed";
  });
}

// A session that names an asset has it, whole: it is on the medium before the session names it.
TEST(PowerCut, LeavesALinkedAssetWhereTheSessionNamesIt) {
  const TemporaryDirectory folder, elsewhere;
  write_content(elsewhere / "asset.glb", "a model");
  FaultyDisk disk(folder.path());
  AssetStore store(folder / "store", {{"a.glb", elsewhere / "asset.glb"}},
                   [](const std::string& what) { ADD_FAILURE() << what; });
  SessionWriter writer(folder / "one", {}, std::chrono::nanoseconds(0));
  const auto order = store.deliver(folder / "one");
  ASSERT_TRUE(wait_until("it is there", [&] { return order->result().has_value(); }));
  writer.set_assets(order->result()->assets, order->result()->missing);
  const std::size_t acknowledged = disk.calls();
  writer.close();
  for_each_power_cut(disk, 0, elsewhere / "after", [&](std::size_t cut) {
    std::size_t assets = 0;
    if (std::filesystem::exists(elsewhere / "after/one/session.toml")) {
      const session::Session session = session::open_session(elsewhere / "after/one");
      assets = session.info.assets.size();
      for (const auto& [as_written, file] : session.info.assets)
        EXPECT_EQ(test::content_of(session.directory / file), "a model");
    }
    EXPECT_TRUE(assets == 1 || cut < acknowledged);
  });
}

// Each call to the disk in turn fails, or writes less than it was given.
class EveryCall : public test::EveryFault {};
INSTANTIATE_TEST_SUITE_P(Fails, EveryCall,
                         ::testing::Values(DiskFault::io_error, DiskFault::no_space,
                                           DiskFault::short_write));

TEST_P(EveryCall, OfASessionThatFailsIsAnErrorAndTheSessionIsNotClosed) {
  const TemporaryDirectory elsewhere;
  write_content(elsewhere / "asset.glb", "a model");
  for_each_call([&](Round& round) {
    int acknowledged = 0;
    const std::string fault = test::error_of([&] {
      write_session(round.folder / "one", elsewhere / "asset.glb",
                    [&](int i) { acknowledged = i + 1; });
    });
    SCOPED_TRACE(round.describe() + ", " + fault);
    bool closed = false;
    const std::optional<int> there = frames_in(round.folder / "one", closed);
    EXPECT_GE(there.value_or(0), std::min(acknowledged, frames));
    EXPECT_EQ(closed, fault.empty());
    // What a failed sync was to keep may be lost from the medium, whatever the kernel says later.
    for (const AfterPowerCut kept : test::power_cuts) {
      round.disk.restore(round.disk.calls(), kept, elsewhere / "after");
      const std::optional<int> after = frames_in(elsewhere / "after" / "one", closed);
      EXPECT_GE(after.value_or(0), std::min(acknowledged, frames));
      EXPECT_EQ(closed, fault.empty()) << static_cast<int>(kept);
    }
  });
}

// Options for disks with room, the first of which perhaps fails.
RecorderOptions options_of(std::vector<std::filesystem::path> folders) {
  RecorderOptions options = recorder_options(std::move(folders));
  options.free_bytes = [](const auto&) { return plenty; };
  return options;
}

// Offers these frames with their tracks, without which the end of a take waits for them.
void offer(Recorder& recorder, int first, int last) {
  for (int i = first; i < last; ++i) {
    recorder.offer(picture(i));
    recorder.offer(track_of(i));
  }
}

// A rig's recorder: the fault is reported, frames on the disk are counted, and the next take is
// whole.
TEST_P(EveryCall, OfARecorderThatFailsEndsTheTakeAndNotTheNext) {
  for_each_call([&](Round& round) {
    RecorderStatus first, second;
    {
      Recorder recorder(options_of({round.folder / "takes"}));
      const auto record = [&](int from) {
        const RecorderStatus before = recorder.status();
        recorder.start();
        offer(recorder, from, from + frames);
        recorder.stop();
        EXPECT_TRUE(wait_until("the take is over", [&] {
          const RecorderStatus status = recorder.status();
          return status.finished_takes > before.finished_takes || status.failures > before.failures;
        }));
        return recorder.status();
      };
      first = record(0);
      second = record(frames);
    }
    SCOPED_TRACE(round.describe() + ", " + first.fault);
    EXPECT_EQ(first.failures + second.failures > 0, !(first.fault + second.fault).empty());
    bool closed = false;
    if (first.failures > 0 && std::filesystem::exists(first.directory / "session.toml")) {
      EXPECT_GE(frames_in(first.directory, closed).value_or(0), static_cast<int>(first.frames));
      EXPECT_FALSE(closed);
    }
    if (first.failures > 0) {
      EXPECT_EQ(second.failures, first.failures) << second.fault;
      // One more came between the takes, and stands in the ring.
      EXPECT_GE(second.frames, static_cast<std::uint64_t>(frames));
    }
    if (second.failures == first.failures) {
      const int begin = 2 * frames - static_cast<int>(second.frames);
      EXPECT_EQ(frames_in(second.directory, closed, begin), static_cast<int>(second.frames));
      EXPECT_TRUE(closed);
    }
    if (first.failures == 0) {
      EXPECT_EQ(frames_in(first.directory, closed), frames);
      EXPECT_TRUE(closed);
    }
  });
}

bool is_closed(const std::filesystem::path& take) {
  return std::filesystem::exists(take / "session.toml") &&
         session::content_of(take / "session.toml").find("closed = true") != std::string::npos;
}

// The next recording has begun when the first take ends, and goes on afterwards: a failure is that
// of one take, and leaves the other whole.
TEST_P(EveryCall, OfARecorderThatHasBegunTheNextTakeCostsOneOfThem) {
  for_each_call([&](Round& round) {
    {
      Recorder recorder(options_of({round.folder / "takes"}));
      recorder.start();
      offer(recorder, 0, frames);
      recorder.stop();
      recorder.start();
      EXPECT_TRUE(wait_until("the first take is over", [&] {
        const RecorderStatus status = recorder.status();
        return status.finished_takes + status.failures > 0;
      }));
      offer(recorder, frames, 2 * frames);
      recorder.stop();
    }
    SCOPED_TRACE(round.describe());
    int whole = 0;
    for (const auto& take : std::filesystem::directory_iterator(round.folder / "takes")) {
      if (!is_closed(take.path())) continue;
      whole += session::open_session(take.path()).missing.empty() &&
               frame_count(take.path()) >= std::uint64_t{frames};
    }
    EXPECT_GE(whole, round.has_failed() ? 1 : 2);
  });
}

// With a second disk the recording goes on there, and every frame that was offered is in one of the
// takes: the frame with which the disk failed, too. A disk that fails while a stopped take is ended
// is that take's failure, and begins no other.
TEST_P(EveryCall, OfTheFirstOfTwoDisksThatFailsLosesNoFrame) {
  const TemporaryDirectory elsewhere;
  write_content(elsewhere / "asset.glb", "a model");
  for_each_call([&](Round& round) {
    const std::filesystem::path second = elsewhere / std::to_string(round.call);
    RecorderOptions options = options_of({round.folder / "takes", second});
    options.take.assets = {{"a.glb", elsewhere / "asset.glb"}};
    RecorderStatus status;
    {
      Recorder recorder(std::move(options));
      recorder.start();
      offer(recorder, 0, frames);
      recorder.stop();
      EXPECT_TRUE(wait_until("it is over", [&] {
        const RecorderStatus now = recorder.status();
        return now.failures > 0 || (!now.recording && now.frames > 0 && !now.finished.empty());
      }));
      recorder.finish();
      status = recorder.status();
    }
    SCOPED_TRACE(round.describe() + ", " + status.fault);
    bool closed = false;
    const std::filesystem::path first = round.folder / "takes/12A_take001";
    const int in_first = frames_in(first, closed).value_or(0);
    const bool is_first_closed = is_closed(first);  // perhaps without its asset
    int in_second = 0;
    bool goes_on = false;  // perhaps without a frame, where only the stop was left
    for (const char* name : {"12A_take001", "12A_take002"}) {
      const std::filesystem::path take = second / name;
      if (!std::filesystem::exists(take)) continue;
      in_second += frames_in(take, closed, in_first).value_or(0);
      goes_on = true;
      EXPECT_TRUE(closed);
    }
    EXPECT_EQ(in_first + in_second, frames);
    EXPECT_FALSE(std::filesystem::exists(second / ".recording")) << "it would record on by itself";
    EXPECT_EQ(status.failures, goes_on || is_first_closed ? 0u : 1u);
  });
}

// A folder that is named with a slash at its end is given up as any other.
TEST(RecorderOfTwoDisks, GoesOnInTheSecondHoweverTheFirstIsNamed) {
  for (const char* name : {"takes", "takes/"}) {
    const TemporaryDirectory folder, elsewhere;
    FaultyDisk disk(folder.path());
    Recorder recorder(options_of({folder / name, elsewhere / "second"}));
    recorder.start();
    offer(recorder, 0, 1);
    ASSERT_TRUE(wait_for_frames(recorder, 1));
    disk.fail_next_write_of("observer.mkv");
    offer(recorder, 1, frames);
    recorder.stop();
    recorder.finish();
    EXPECT_EQ(recorder.status().directory, elsewhere / "second/12A_take002") << name;
  }
}

// A folder that cannot forget that somebody records keeps no other from it.
TEST(TakeFolders, OfWhichOneFailsForgetTheWishInTheOther) {
  const TemporaryDirectory folder, elsewhere;
  FaultyDisk disk(folder.path());
  session::make_folders(elsewhere / "second");
  session::make_folders(folder / "takes");
  const TakeFolders folders({folder / "takes", elsewhere / "second"}, 0, {});
  TakeFolders::keep_wish(folder / "takes/12A_take001");
  TakeFolders::keep_wish(elsewhere / "second/12A_take002");
  disk.fail(disk.calls() + 1, DiskFault::io_error);  // the file is removed, and its name not synced
  EXPECT_THROW(folders.drop_wish(), Error);
  EXPECT_FALSE(folders.kept_wish());
}

}  // namespace previz::output::session_power_test
