// A recording that goes on in a second folder, and what is kept before the button.
#include "daemon/core/output/take_folders.hpp"

#include "daemon/core/output/folder_watch.hpp"
#include "daemon/core/session/files.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/recorder_fixture.hpp"
#include "tests/support/test.hpp"

namespace previz::output::take_folders_test {

using session::mentions;
using session::TemporaryDirectory;
using test::wait_until;

std::string refusal(TakeFolders& folders) {
  return test::error_of([&] { folders.choose(); });
}

TEST(TakeFolders, TheFirstThatHasRoomAndDidNotFailIsChosen) {
  const TemporaryDirectory directory;
  const std::filesystem::path first = directory / "a/takes", second = directory / "b/takes";
  std::map<std::filesystem::path, std::uint64_t> free = {{first, plenty}, {second, plenty}};
  TakeFolders folders({first, second}, 5'000'000, [&](const auto& folder) { return free[folder]; });
  EXPECT_EQ(folders.choose(), 0u);
  EXPECT_TRUE(std::filesystem::is_directory(first));
  EXPECT_FALSE(std::filesystem::exists(second));
  free[first] = 4'999'999;
  EXPECT_EQ(folders.choose(), 1u);
  EXPECT_TRUE(std::filesystem::is_directory(second));
  EXPECT_TRUE(folders.give_up(0, first.string() + ": its disk failed"));
  EXPECT_FALSE(folders.give_up(1, second.string() + ": its disk failed"));
  EXPECT_EQ(refusal(folders),
            first.string() + ": its disk failed; " + second.string() + ": its disk failed");
  folders.forgive_all();
  free[second] = 3'000'000;
  EXPECT_EQ(refusal(folders), first.string() +
                                  ": the disk is almost full, 4 MB are free, 5 MB are reserved "
                                  "(recording.reserve_mb); " +
                                  second.string() +
                                  ": the disk is almost full, 3 MB are free, 5 MB are reserved "
                                  "(recording.reserve_mb)");
}

TEST(TakeFolders, ADiskThatWasGivenUpHasNoRoomForTakes) {
  const TemporaryDirectory directory;
  TakeFolders folders({directory / "takes"}, 20, {});
  FolderSeen seen;
  seen.free_bytes = 100;
  EXPECT_EQ(folders.free_bytes({seen}), 80u);
  folders.give_up(0, "it failed");
  EXPECT_FALSE(folders.free_bytes({seen}));
  folders.forgive_all();
  EXPECT_EQ(folders.free_bytes({seen}), 80u);
  seen.why_not = "Read-only file system";
  EXPECT_FALSE(folders.free_bytes({seen}));
}

TEST(TakeFolders, AFolderThatCannotBeMadeIsPassedOverByName) {
  const TemporaryDirectory directory;
  session::write_content(directory / "file", "no folder");
  TakeFolders folders({directory / "file/takes", directory / "b"}, 0, {});
  EXPECT_EQ(folders.choose(), 1u);
  folders.give_up(1, "its disk failed");
  EXPECT_THAT(refusal(folders), HasSubstr("file/takes"));
}

TEST(TakeFolders, AWishIsKeptInTheFolderOfItsTakeAndTheNewestCounts) {
  const TemporaryDirectory directory;
  const TakeFolders folders({directory / "a", directory / "b"}, 0, {});
  EXPECT_FALSE(folders.kept_wish());
  for (const char* folder : {"a", "b"}) session::make_folders(directory / folder);
  TakeFolders::keep_wish(directory / "a/12A_take003");
  EXPECT_EQ(folders.kept_wish()->take, "12A_take003");
  TakeFolders::keep_wish(directory / "b/12A_take004");
  std::filesystem::last_write_time(
      directory / "a/.recording",
      std::filesystem::last_write_time(directory / "b/.recording") - std::chrono::seconds(1));
  EXPECT_EQ(folders.kept_wish()->take, "12A_take004");
  folders.drop_wish();
  EXPECT_FALSE(folders.kept_wish());
}

TEST(TakeFolders, TheSpeedOfADiskIsMeasuredAndNothingStays) {
  const TemporaryDirectory directory;
  TakeFolders folders({directory / "takes"}, 0, {});
  EXPECT_GT(folders.measure_speed().value_or(0), 0);
  EXPECT_TRUE(std::filesystem::is_empty(directory / "takes"));
  TakeFolders small({directory / "takes"}, 0, [](const auto&) { return 100'000'000; });
  EXPECT_EQ(small.measure_speed(), std::nullopt);
}

TEST(NextTakeNumber, CountsThroughAllFoldersAndIgnoresAbsurdNumbers) {
  const TemporaryDirectory directory;
  for (const char* take : {"a/12A_take003", "b/12A_take007", "b/12A_take2147483647",
                           "a/12B_take009", "a/12A_takeover"})
    session::make_folders(directory / take);
  EXPECT_EQ(next_take_number({directory / "a", directory / "b", directory / "none"}, "12A"), 8);
  EXPECT_EQ(next_take_number({directory / "a", directory / "b"}, "12A", 11), 12);
}

TEST(TakeFolders, KeepTheHighestTakeOfEachSlate) {
  const TemporaryDirectory directory;
  for (const char* folder : {"a", "b"}) session::make_folders(directory / folder);
  const TakeFolders folders({directory / "a", directory / "b", directory / "none"}, 0, {});
  EXPECT_EQ(folders.kept_number("12A"), 0);
  TakeFolders::keep_number(directory / "a", "12A", 7);
  TakeFolders::keep_number(directory / "a", "12B", 2);
  TakeFolders::keep_number(directory / "b", "12A", 9);
  TakeFolders::keep_number(directory / "b", "12A", 8);
  EXPECT_EQ(folders.kept_number("12A"), 9);
  EXPECT_EQ(folders.kept_number("12B"), 2);
  EXPECT_EQ(folders.kept_number("12"), 0);
  EXPECT_EQ(test::content_of(directory / "a/.highest_takes"), "12B_take002\n12A_take007\n");
  std::ofstream(directory / "a/.highest_takes") << "12B_take002\n\nnothing\n12B_take";
  EXPECT_EQ(folders.kept_number("12B"), 2);
}

// A file of no content may claim any size, and one of 30 million lines is no list of takes.
TEST(TakeFolders, WhatIsNoListOfTakesSaysNothingAndIsNamed) {
  const TemporaryDirectory directory;
  const std::filesystem::path list = directory / ".highest_takes", wish = directory / ".recording";
  const TakeFolders folders({directory.path()}, 0, {});
  for (const std::uintmax_t bytes : {std::uintmax_t{40} << 30, std::uintmax_t{1} << 20}) {
    for (const auto& file : {list, wish}) {
      std::ofstream(file, std::ios::trunc).close();
      std::filesystem::resize_file(file, bytes);
    }
    std::vector<std::string> said;
    const auto note = [&](const std::string& what) { said.push_back(what); };
    EXPECT_EQ(folders.kept_number("12A", note), 0);
    EXPECT_FALSE(folders.kept_wish(note));
    EXPECT_THAT(said, ElementsAre(HasSubstr(".highest_takes: is too large for a list of takes, "
                                            "which has at most 64 KiB"),
                                  HasSubstr(".recording: is too large")));
    TakeFolders::keep_number(directory.path(), "12A", 7);
    EXPECT_EQ(folders.kept_number("12A"), 7);
    EXPECT_EQ(test::content_of(list), "12A_take007\n");
  }
}

TEST(TakeFolders, AreOnOneDiskWhereTheFoldersAboveThemAre) {
  const TemporaryDirectory directory;
  EXPECT_TRUE(are_on_one_disk(directory / "not/made", directory / "yet"));
  EXPECT_FALSE(are_on_one_disk(directory.path(), "/proc"));
}

// 25 frames of 2304 bytes a second, of which 23040 bytes hold 10; 4 s are wished, or 0.3 s.
TEST(Recorder, ThatCannotKeepWhatIsWishedBeforeTheButtonSaysSoOnce) {
  for (const auto& [wished_s, frames] : {std::pair(4.0, 10u), {0.3, 8u}}) {
    TwoDisks disks;
    RecorderOptions options = disks.options();
    options.preroll_s = wished_s;
    options.queue_bytes = 2 * 23040;
    Recorder recorder(std::move(options));
    for (std::uint64_t i = 0; i < 40; ++i) recorder.offer(picture(i));
    recorder.start();
    ASSERT_TRUE(wait_for_frames(recorder, frames));
    if (wished_s < 1) {
      EXPECT_THAT(disks.heard.notes(), IsEmpty());
      continue;
    }
    EXPECT_EQ(std::ranges::count(disks.heard.notes(),
                                 "recording: takes begin 0.4 s before the button, not 4.0 s: "
                                 "the frame memory is full (recording.queue_mb)"),
              1);
  }
}

TEST(Recorder, WarnsOfADiskThatIsTooSlowForTheCameras) {
  TwoDisks disks;
  RecorderOptions options = disks.options();
  options.preroll_s = 4e-6;
  options.measures_disk = true;
  Recorder recorder(std::move(options));
  // Pictures 100 ns apart are 23 GB a second, more than one thread copies.
  for (std::uint64_t i = 0; i < 40; ++i) {
    Frame frame = *picture(i);
    frame.timestamp_ns = static_cast<std::int64_t>(100 * i);
    recorder.offer(std::make_shared<Frame>(std::move(frame)));
  }
  EXPECT_TRUE(wait_until("it is compared", [&] {
    return disks.heard.said("takes will miss frames; recording.codec = \"raw\" needs");
  }));
}

TEST(Recorder, WritesTheFormThatTheSetWants) {
  TwoDisks disks;
  RecorderOptions options = disks.options();
  options.take.codec = session::VideoCodec::raw;
  Recorder recorder(std::move(options));
  recorder.start();
  for (std::uint64_t i = 0; i < 3; ++i) recorder.offer(picture(i));
  end_take(recorder);
  const std::filesystem::path take = disks.first / "12A_take001";
  EXPECT_EQ(frames_of(take), count_from(0, 2));
  EXPECT_THAT(session::open_session(take).missing, IsEmpty());
  EXPECT_THAT(test::content_of(take / "session.toml"), HasSubstr("codec = \"raw\""));
}

// As `umount -l` does it: files that are open stay so, and nobody finds them by name.
TEST(Recorder, WhoseTakeIsGoneGoesOnOnTheNextDisk) {
  TwoDisks rig;
  Recorder recorder(rig.options());
  ASSERT_TRUE(begin_take(recorder));
  std::filesystem::rename(rig.first, rig.directory / "unmounted");
  std::filesystem::create_directory(rig.first);
  ASSERT_TRUE(wait_until("it goes on", [&] { return recorder.status().number == 2; }));
  recorder.offer(picture(1));
  end_take(recorder);
  EXPECT_EQ(recorder.status().directory, rig.second / "12A_take002");
  EXPECT_TRUE(mentions(missing_of(rig.directory / "unmounted/12A_take001"), "not closed"));
  EXPECT_TRUE(rig.heard.said("is gone; its disk was unmounted"));
}

TEST(Recorder, ThatFindsAnotherInItsFolderLeavesItAlone) {
  const TemporaryDirectory directory;
  RecorderOptions options = recorder_options({directory / "takes"});
  options.reserve_bytes = 0;
  auto first = std::make_unique<Recorder>(options);
  ASSERT_TRUE(begin_take(*first));
  {
    Recorder second(options);
    ASSERT_TRUE(wait_until("it has looked", [&] { return second.folders()[0].is_looked_at; }));
    EXPECT_THAT(second.folders()[0].why_not, HasSubstr("another previzd records there (process "));
    EXPECT_TRUE(second.status().salvaged.empty());
    second.start();
    second.offer(picture(5));
    ASSERT_TRUE(wait_for_failures(second, 1));
    EXPECT_THAT(second.status().fault, HasSubstr("another previzd"));
    EXPECT_FALSE(second.status().interrupted);
  }
  first->offer(picture(1));
  first->stop();
  first->finish();
  EXPECT_EQ(first->status().failures, 0u);
  first.reset();
  EXPECT_THAT(missing_of(directory / "takes/12A_take001"), IsEmpty());
  // Whoever is left takes the folder over.
  Recorder third(options);
  EXPECT_TRUE(wait_until("it has the folder", [&] { return third.folders()[0].is_own; }));
}

}  // namespace previz::output::take_folders_test
