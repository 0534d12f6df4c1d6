// Takes whose disks, files of the set or frames are not as they should be: the recording goes on,
// and each take says what it lacks.
#include <fcntl.h>
#include <sys/stat.h>

#include "daemon/core/session/files.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/cut_off_take.hpp"
#include "tests/support/recorder_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::output::take_ends_test {

using session::mentions;
using session::write_content;
using test::wait_until;

// The SHA-256 of "a model", as sha256sum has it.
constexpr char hash_of_a_model[] =
    "97ff8a35544dcf40ad84047074439dd6aa3a0be469ea578a1b1c017d939ec61c";

std::filesystem::path kept_in(const std::filesystem::path& folder) {
  return folder / ".assets" / (std::string(hash_of_a_model) + ".glb");
}

// Two disks, and a set with one file.
struct Rig : TwoDisks {
  RecorderOptions options() {
    RecorderOptions options = TwoDisks::options();
    options.asset_patience = std::chrono::milliseconds(500);
    return options;
  }
  RecorderOptions options_with_asset() {
    write_content(directory / "set/a.glb", "a model");
    RecorderOptions with = options();
    with.take.assets = {{"a.glb", directory / "set/a.glb"}};
    return with;
  }
  [[nodiscard]] testing::AssertionResult wait_for_asset() const {
    return wait_until("the file is kept", [&] { return exists(kept_in(first)); });
  }
};

// ---- files of the set

TEST(Recorder, OfTwoDisksHasTheAssetsOnBothBeforeTheyAreNeeded) {
  Rig rig;
  Recorder recorder(rig.options_with_asset());
  ASSERT_TRUE(wait_until("both have it", [&] {
    return std::filesystem::exists(kept_in(rig.first)) &&
           std::filesystem::exists(kept_in(rig.second));
  }));
  ASSERT_TRUE(begin_take(recorder));
  // The first disk is gone with what it kept, and so is the disk of the set.
  rig.free_on_first = 0;
  std::filesystem::remove_all(rig.first / ".assets");
  std::filesystem::remove_all(rig.directory / "set");
  ASSERT_TRUE(wait_for_take(recorder, 2));
  recorder.offer(picture(1));
  end_take(recorder);
  EXPECT_EQ(recorder.status().failures, 0u);
  const session::Session session = session::open_session(rig.second / "12A_take002");
  EXPECT_TRUE(session.missing.empty()) << session.missing.front();
  EXPECT_EQ(test::content_of(session.directory / session.info.assets.at("a.glb")), "a model");
}

TEST(Recorder, WithoutAFileOfTheSetRecordsAndTheTakeSaysWhichItWas) {
  Rig rig;
  Recorder recorder(rig.options_with_asset());
  ASSERT_TRUE(rig.wait_for_asset());
  std::filesystem::remove_all(rig.first / ".assets");
  std::filesystem::remove_all(rig.directory / "set");
  ASSERT_TRUE(begin_take(recorder));
  end_take(recorder);
  EXPECT_EQ(recorder.status().failures, 0u);
  EXPECT_EQ(recorder.status().finished, "12A_take001");
  const session::Session session = session::open_session(rig.first / "12A_take001");
  ASSERT_EQ(session.info.missing_assets.size(), 1u);
  const session::MissingAsset& asset = session.info.missing_assets.front();
  EXPECT_EQ(asset.as_written, "a.glb");
  EXPECT_EQ(asset.file, rig.directory / "set/a.glb");
  EXPECT_EQ(asset.sha256, hash_of_a_model);
  EXPECT_FALSE(asset.why.empty());
  EXPECT_TRUE(mentions(session.missing, "a.glb: missing from the take"));
  EXPECT_TRUE(rig.heard.said("12A_take001 is missing a.glb"));
}

TEST(Recorder, OfAStoreThatWasDeletedTakesTheFileOfTheSetIfItIsTheSame) {
  Rig rig;
  Recorder recorder(rig.options_with_asset());
  ASSERT_TRUE(rig.wait_for_asset());
  for (const char* content : {"a model", "another model"}) {
    std::filesystem::remove_all(rig.first / ".assets");
    write_content(rig.directory / "set/a.glb", content);
    const std::uint64_t takes = recorder.status().finished_takes;
    record_take(recorder, takes);
    ASSERT_TRUE(wait_for_finished(recorder, takes + 1));
  }
  const session::Session same = session::open_session(rig.first / "12A_take001");
  EXPECT_EQ(test::content_of(same.directory / same.info.assets.at("a.glb")), "a model");
  const session::Session changed = session::open_session(rig.first / "12A_take002");
  EXPECT_TRUE(changed.info.assets.empty());
  EXPECT_TRUE(mentions(changed.missing, "was changed since the set was loaded"));
}

TEST(Recorder, LeavesTheReserveToTakesAndNotToTheFilesOfTheSet) {
  Rig rig;
  rig.free_on_first = 103;  // the reserve of 100 bytes, and less than the model's 7
  Recorder recorder(rig.options_with_asset());
  ASSERT_TRUE(
      wait_until("it is said", [&] { return rig.heard.said("a.glb will be missing from takes"); }));
  EXPECT_FALSE(std::filesystem::exists(kept_in(rig.first)));
  ASSERT_TRUE(begin_take(recorder));
  end_take(recorder);
  EXPECT_EQ(recorder.status().failures, 0u);
  EXPECT_TRUE(mentions(missing_of(rig.first / "12A_take001"), "almost full"));
}

// A pipe that nobody writes to, as a file on a mount that is dead.
TEST(Recorder, EndsATakeAndItselfWhileAFileOfTheSetCannotBeRead) {
  Rig rig;
  const std::filesystem::path pipe = rig.directory / "dead.glb";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  RecorderOptions options = rig.options();
  options.take.assets = {{"dead.glb", pipe}};
  {
    Recorder recorder(std::move(options));
    record_take(recorder);
    ASSERT_TRUE(wait_for_finished(recorder, 1));
    recorder.start();
    recorder.offer(picture(1));
    ASSERT_TRUE(wait_for_take(recorder, 2));
  }
  for (const char* take : {"12A_take001", "12A_take002"}) {
    const session::Session session = session::open_session(rig.first / take);
    ASSERT_EQ(session.missing.size(), 1u);
    EXPECT_TRUE(mentions(session.missing, "dead.glb: missing from the take")) << session.missing[0];
  }
}

// ---- numbers, losses, and what cannot be recorded

// The first disk is mounted later than the service starts; the second one knows what is on it.
TEST(Recorder, GivesNoTakeTheNameOfOneOnADiskThatIsNotThere) {
  Rig rig;
  for (const std::filesystem::path& folder : {rig.first, rig.second})  // each is a disk's uppermost
    session::make_folders(folder);
  const auto record_once = [&] {
    Recorder recorder(rig.options());
    record_take(recorder);
    EXPECT_TRUE(wait_for_finished(recorder, 1));
    EXPECT_TRUE(wait_for_its_look(recorder));
    return recorder.status().directory;
  };
  EXPECT_EQ(record_once(), rig.first / "12A_take001");
  EXPECT_EQ(record_once(), rig.first / "12A_take002");
  std::filesystem::rename(rig.first, rig.directory / "elsewhere");
  write_content(rig.first, "no folder");
  EXPECT_EQ(record_once(), rig.second / "12A_take003");
  std::filesystem::remove(rig.first);
  std::filesystem::rename(rig.directory / "elsewhere", rig.first);
  std::filesystem::rename(rig.second, rig.directory / "elsewhere");
  write_content(rig.second, "no folder");
  EXPECT_EQ(record_once(), rig.first / "12A_take003");  // nobody could tell the first disk
}

// With both disks there, what was on them and is there no longer gives its number away.
TEST(Recorder, NumbersTakesByWhatIsThereWhereAllDisksAre) {
  Rig rig;
  for (const std::filesystem::path& folder : {rig.first, rig.second}) {
    session::make_folders(folder);
    TakeFolders::keep_number(folder, "12A", 7);
  }
  session::make_folders(rig.second / "12A_take004");
  Recorder recorder(rig.options());
  EXPECT_TRUE(wait_for_its_look(recorder));
  record_take(recorder);
  ASSERT_TRUE(wait_for_finished(recorder, 1));
  EXPECT_EQ(recorder.status().directory, rig.first / "12A_take005");
}

TEST(Recorder, LeavesOutWhatCannotBeRecordedAndGoesOn) {
  Rig rig;
  const auto nothing = std::numeric_limits<double>::quiet_NaN();
  Frame without_gain = *picture(0);
  without_gain.gain = without_gain.exposure = nothing;
  session::TrackRecord astray = track_of(1);
  astray.tracked = true;
  astray.world_from_camera[3][0] = nothing;
  Recorder recorder(rig.options());
  recorder.start();
  recorder.offer(std::make_shared<Frame>(without_gain));
  for (std::uint64_t i = 1; i < 4; ++i) recorder.offer(picture(i));
  recorder.offer(astray);
  recorder.offer_event(0, "not UTF-8: \xff");
  for (std::uint64_t i = 2; i < 4; ++i) recorder.offer(track_of(i));
  end_take(recorder);
  const RecorderStatus status = recorder.status();
  EXPECT_EQ(status.failures, 0u) << status.fault;
  EXPECT_EQ(status.directory, rig.first / "12A_take001");
  EXPECT_EQ(status.lost, (session::Losses{1, 0, 2}));
  EXPECT_EQ(rig.heard.left_out(), (Causes{{"cannot be recorded", 1}}));
  EXPECT_EQ(frame_count(rig.first / "12A_take001"), 3u);
  const session::Session session = session::open_session(rig.first / "12A_take001");
  EXPECT_EQ(session.track.size(), 2u);
  EXPECT_EQ(session.missing.size(), 2u);
  for (const std::string& words : session::words_of(status.lost))
    EXPECT_TRUE(mentions(session.missing, words)) << words;
  EXPECT_TRUE(rig.heard.said("12A_take001 is missing what cannot be recorded: frame 100"));
}

// The first recording loses frames, rolls over twice, and is still being written when the next one
// begins.
TEST(Recorder, CountsTheLossesOfEachTakeThoughTheNextRecordingHasBegun) {
  Rig rig;
  std::mutex disk;
  RecorderOptions options = rig.options();
  options.queue_bytes = 4 * picture(0)->bytes.size();
  options.free_bytes = [&](const auto&) {  // the writer asks the disk once a second
    const std::lock_guard lock(disk);
    return plenty;
  };
  Recorder recorder(std::move(options));
  const auto wait_for_the_disk_to_hang = [&] {
    return wait_until("the disk hangs", [&] { return recorder.status().disk_silent_s > 0.1; });
  };
  ASSERT_TRUE(begin_take(recorder));
  disk.lock();
  ASSERT_TRUE(wait_for_the_disk_to_hang());
  for (std::uint64_t i = 1; i <= 10; ++i) recorder.offer(picture(i));  // 4 of them fit
  EXPECT_EQ(recorder.status().lost.frames, 6u);
  disk.unlock();
  ASSERT_TRUE(wait_for_frames(recorder, 5));
  recorder.offer(picture(11, "observer", 40));
  ASSERT_TRUE(wait_for_take(recorder, 2));
  disk.lock();
  ASSERT_TRUE(wait_for_the_disk_to_hang());
  recorder.offer(picture(12));
  recorder.stop();
  recorder.start();
  EXPECT_EQ(recorder.status().lost, session::Losses{});
  recorder.offer(picture(13));
  disk.unlock();
  end_take(recorder);
  EXPECT_EQ(recorder.status().failures, 0u) << recorder.status().fault;
  // What was lost was offered before the frame that began the second take, and after the last of
  // the first that was written: whichever of the two says it, no other does.
  std::size_t takes_that_lack = 0;
  for (const char* name : {"12A_take001", "12A_take002", "12A_take003", "12A_take004"}) {
    const session::Session session = session::open_session(rig.first / name);
    EXPECT_EQ(session.missing.empty(), !mentions(session.missing, "6 camera frames"));
    takes_that_lack += session.missing.empty() ? 0 : 1;
  }
  EXPECT_EQ(takes_that_lack, 1u);
  EXPECT_EQ(rig.heard.left_out(), (Causes{{"memory full", 6}}));
}

// ---- from one take to the next

// The first disk is full: every frame is in one of the two takes, bit for bit and in order. Tracks
// come three frames late, as the tracking takes its time.
TEST(Recorder, FromOneDiskToTheNextKeepsTheTracksOfTheLastFramesAndTheLight) {
  Rig rig;
  constexpr std::uint64_t behind = 3;
  std::uint64_t offered = 0;
  {
    Recorder recorder(rig.options());
    recorder.start();
    recorder.offer(picture(0, "light"));
    const auto offer = [&] {
      recorder.offer(picture(offered));
      if (offered >= behind) recorder.offer(track_of(offered - behind));
      ++offered;
    };
    for (int i = 0; i < 5; ++i) offer();
    ASSERT_TRUE(wait_for_frames(recorder, 5));
    rig.free_on_first = 50;
    ASSERT_TRUE(wait_until("the second take runs", [&] {
      offer();
      std::this_thread::sleep_for(std::chrono::milliseconds(10));  // as a camera does
      return recorder.status().number == 2;
    }));
    for (int i = 0; i < 5; ++i) offer();
    ASSERT_TRUE(wait_until("the first take is finished",
                           [&] { return recorder.status().finished == "12A_take001"; }));
    EXPECT_TRUE(recorder.status().recording);
    EXPECT_EQ(recorder.status().failures, 0u);
    for (std::uint64_t i = offered - behind; i < offered; ++i) recorder.offer(track_of(i));
  }
  std::vector<std::uint64_t> frames;
  for (const std::filesystem::path& take :
       {rig.first / "12A_take001", rig.second / "12A_take002"}) {
    const session::Session session = session::open_session(take);
    EXPECT_TRUE(session.missing.empty()) << session.missing.front();
    EXPECT_EQ(session.track.size(), frame_count(take));
    EXPECT_EQ(frame_count(take, "light"), 1u);
    std::ranges::copy(frames_of(take), std::back_inserter(frames));
  }
  EXPECT_EQ(frames, count_from(0, offered - 1));
  EXPECT_TRUE(rig.heard.said("the disk of 12A_take001 is almost full; recording continues in " +
                             (rig.second / "12A_take002").string()));
}

// A disk whose free space goes up and down about the reserve, as takes that are closed give some
// back.
TEST(Recorder, NearTheReserveDoesNotFallApartIntoShortTakes) {
  Rig rig;
  std::atomic<bool> is_near = false;
  std::atomic<unsigned> asked = 0;
  RecorderOptions options = rig.options();
  options.take.folders = {rig.first};
  options.free_bytes = [&](const auto&) -> std::uint64_t {
    // Every third answer, so that who asks every second time is not told the same for ever.
    return !is_near ? plenty : ++asked % 3 == 1 ? 50 : 150;
  };
  Recorder recorder(std::move(options));
  std::uint64_t next = 0;
  ASSERT_TRUE(begin_take(recorder, next++));
  is_near = true;
  ASSERT_TRUE(wait_until("it ends", [&] {
    recorder.offer(picture(next++));
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    return !recorder.status().recording || recorder.status().number > 1;
  }));
  EXPECT_EQ(recorder.status().number, 1);
  EXPECT_THAT(recorder.status().fault, HasSubstr("almost full"));
  recorder.start();
  recorder.offer(picture(next));
  EXPECT_TRUE(wait_until("somebody begins again", [&] {
    return recorder.status().number == 2 || recorder.status().failures == 2;
  }));
}

// ---- what an earlier process left

// A take that was cut off, and the wish to record on.
void leave_a_cut_off_take(const std::filesystem::path& folder) {
  test::write_cut_off_take(folder / "12A_take007", 3);
  TakeFolders::keep_wish(folder / "12A_take007");
}

TEST(Recorder, WhoseFirstFolderCannotBeReadFindsWhatIsInTheSecond) {
  Rig rig;
  write_content(rig.first, "no folder");
  leave_a_cut_off_take(rig.second);
  const Recorder recorder(rig.options());
  ASSERT_TRUE(wait_for_its_look(recorder));
  EXPECT_EQ(recorder.status().salvaged,
            std::vector<std::string>{"12A_take007 was cut off; it has 3 frames"});
  EXPECT_EQ(recorder.status().interrupted, "12A_take007");
  EXPECT_TRUE(rig.heard.said("earlier takes cannot be checked"));
}

TEST(Recorder, FindsWhatIsOnADiskThatIsMountedLater) {
  Rig rig;
  std::filesystem::create_directory(rig.first);
  const Recorder recorder(rig.options());
  ASSERT_TRUE(wait_for_its_look(recorder));
  EXPECT_EQ(recorder.status().interrupted, std::nullopt);
  leave_a_cut_off_take(rig.directory / "mounted");
  std::filesystem::rename(rig.directory / "mounted", rig.second);
  ASSERT_TRUE(wait_until("it is found", [&] { return recorder.status().interrupted.has_value(); }));
  EXPECT_EQ(recorder.status().salvaged.size(), 1u);
}

TEST(Recorder, ThatHasRecordedTakesNoOldWishForOne) {
  Rig rig;
  Recorder recorder(rig.options());
  record_take(recorder);
  ASSERT_TRUE(wait_for_finished(recorder, 1));
  leave_a_cut_off_take(rig.directory / "mounted");
  std::filesystem::rename(rig.directory / "mounted", rig.second);
  ASSERT_TRUE(wait_until("it is found", [&] { return !recorder.status().salvaged.empty(); }));
  EXPECT_EQ(recorder.status().interrupted, std::nullopt);
}

}  // namespace previz::output::take_ends_test
