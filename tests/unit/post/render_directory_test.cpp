// What a render leaves behind, and how the next one goes on from it.
#include "daemon/tools/post/render_directory.hpp"

#include "daemon/core/output/exr.hpp"
#include "daemon/core/output/png.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/files.hpp"
#include "daemon/tools/post/render.hpp"
#include "daemon/tools/post/render_files.hpp"
#include "drivers/plate.hpp"
#include "tests/support/child_process.hpp"
#include "tests/support/session_fixture.hpp"
#include "tests/support/small_shot.hpp"
#include "tests/support/test.hpp"

namespace previz::post::render_directory_test {

using session::content_of, session::write_content;

constexpr const char* settings =
    R"({"samples": 16, "set": "a text that is too long to be repeated in an error message, as sets are"})";

pipeline::Shot sample_shot(std::uint64_t index) {
  pipeline::Shot shot = test::small_shot(index);
  shot.track.status = tracking::TrackStatus::tracked;
  shot.track.pose.emplace();
  shot.track.pose->world_from_camera[3] = {0.1, -0.2, 0.3, 1.0};
  shot.track.pose->covariance[7] = 1e-6;
  shot.track.pose->tags = {0, 3};
  pipeline::Light light;
  light.sequences = {4, 5};
  light.lighting.sources = {{3, {0.6, 0, 0.8}, 0.01, {3, 2, 1.0 / 3}}};
  light.lighting.report.dropped_share = 0.25;
  shot.light = std::make_shared<pipeline::Light>(light);
  shot.counters.rays = 1234;
  shot.counters.unfinished = 5;
  shot.counters.rebuilt_trees = 2;
  return shot;
}

class RenderDirectoryTest : public testing::Test {
 protected:
  RenderDirectory open(const char* text = settings, bool force = false) const {
    return RenderDirectory(output_, text, force);
  }
  // Writes the first frames.
  void write_frames(std::uint64_t count) const {
    RenderDirectory directory = open();
    for (std::uint64_t frame = 0; frame < count; ++frame) directory.write(sample_shot(frame), set_);
  }
  // Which of the frames up to the last are finished, one letter for each: "y" or "n".
  static std::string finished(const RenderDirectory& directory, std::uint64_t last) {
    std::string letters;
    for (std::uint64_t frame = 0; frame <= last; ++frame)
      letters += directory.finished(frame) ? 'y' : 'n';
    return letters;
  }
  void halve(const char* name) const {
    const std::filesystem::path file = output_.directory / name;
    std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  }
  test::TemporaryDirectory directory_;
  set::Output output_{directory_ / "out", true, true, true};
  set::Set set_;
};

TEST_F(RenderDirectoryTest, WritesNumberedFilesAndALineAFrame) {
  RenderDirectory directory = open();
  EXPECT_EQ(directory.finished(7), nullptr);
  directory.write(sample_shot(7), set_);
  EXPECT_NE(directory.finished(7), nullptr);
  EXPECT_EQ(output::read_exr(directory_ / "out/0007.exr").width, 8);
  EXPECT_EQ(output::read_png(directory_ / "out/0007.png").samples.front(), 99);

  const RenderDirectory again = open();
  const FinishedFrame* record = again.finished(7);
  ASSERT_NE(record, nullptr);
  EXPECT_EQ(record->timestamp_ns, 1'280'000'000);
  EXPECT_EQ(record->samples, 16);
  EXPECT_EQ(record->status, FrameStatus::rendered);
  ASSERT_TRUE(record->pose);
  EXPECT_EQ(record->pose->world_from_camera[3][2], 0.3);
  EXPECT_EQ(record->pose->covariance[7], 1e-6);
  EXPECT_EQ(record->pose->tags, (std::vector<int>{0, 3}));
  EXPECT_EQ(record->light_frames, (std::vector<std::uint64_t>{4, 5}));
  EXPECT_EQ(record->light_sources, sample_shot(7).light->lighting.sources);
  EXPECT_EQ(record->light_dropped_share, 0.25);
  EXPECT_EQ(record->counters.rays, 1234u);
  EXPECT_EQ(record->counters.unfinished, 5u);
  EXPECT_EQ(record->counters.rebuilt_trees, 2u);
  EXPECT_TRUE(again.rejected().empty());
  for (const char* name : {"0007.exr", "0007.png"}) {
    ASSERT_TRUE(record->files.contains(name));
    EXPECT_EQ(record->files.at(name).bytes, content_of(directory_ / "out" / name).size());
    EXPECT_EQ(record->files.at(name).sha256, session::sha256_of(directory_ / "out" / name));
  }
}

TEST_F(RenderDirectoryTest, ALineSaysWhichDeviceMadeTheFrame) {
  const MadeOn card{"Some Card 9000", true};
  open().write(sample_shot(0), set_, card);
  open().write(sample_shot(1), set_);
  const RenderDirectory again = open();
  EXPECT_EQ(again.finished(0)->made_on, card);
  EXPECT_EQ(again.finished(1)->made_on, MadeOn{});
}

// The lines of rejected frames stay until they are forgotten, and their files stay for good.
TEST_F(RenderDirectoryTest, KeepsWhatItCountsAsNotFinished) {
  {
    RenderDirectory directory = open();
    directory.write(sample_shot(0), set_, {"a card", true});
    directory.write(sample_shot(1), set_, {"a processor", false});
    const auto rejected =
        directory.reject([](const FinishedFrame& frame) { return frame.made_on.is_gpu; });
    ASSERT_EQ(rejected.size(), 1u);
    EXPECT_EQ(finished(directory, 1), "ny");
    EXPECT_EQ(finished(open(), 1), "yy");
    directory.forget(rejected);
  }
  EXPECT_EQ(finished(open(), 1), "ny");
  EXPECT_TRUE(std::filesystem::exists(directory_ / "out/0000.exr"));
}

TEST_F(RenderDirectoryTest, UntouchedFrameSaysWhyAndHasNoPose) {
  pipeline::Shot shot = sample_shot(0);
  shot.track = {};
  shot.track.reason = "no tag of the map is seen";
  shot.untouched = "pose lost: no tag of the map is seen";
  open().write(shot, set_);
  const RenderDirectory again = open();
  ASSERT_NE(again.finished(0), nullptr);
  EXPECT_EQ(again.finished(0)->status, FrameStatus::untouched);
  EXPECT_EQ(again.finished(0)->reason, shot.untouched);
  EXPECT_FALSE(again.finished(0)->pose);
}

TEST_F(RenderDirectoryTest, AMissingFileOrAHalfLineMeansTheFrameIsDoneAgain) {
  write_frames(3);
  std::filesystem::remove(directory_ / "out/0001.exr");
  std::ofstream(directory_ / "out/frames.jsonl", std::ios::app) << R"({"frame":3,"timesta)";
  {
    RenderDirectory directory = open();
    EXPECT_EQ(finished(directory, 3), "ynyn");
    directory.write(sample_shot(3), set_);  // its line must not run into the half one
  }
  EXPECT_NE(open().finished(3), nullptr);
}

// Frames 0 to 5; each but the first is damaged in its own way, and the reason says which.
TEST_F(RenderDirectoryTest, AFileThatIsNotAsItWasWrittenIsDoneAgain) {
  write_frames(6);
  const std::filesystem::path out = directory_ / "out";
  for (const char* name : {"0001.exr", "0002.png"}) halve(name);
  for (const char* name : {"0003.exr", "0004.png"}) {
    std::string bytes = content_of(out / name);
    bytes[bytes.size() / 2] ^= 0x10;
    write_content(out / name, bytes);
  }
  std::string lines = content_of(out / "frames.jsonl");
  lines.resize(lines.rfind("{\"frame\":5") + 20);  // the last line is torn
  write_content(out / "frames.jsonl", lines);

  const RenderDirectory again = open();
  EXPECT_EQ(finished(again, 5), "ynnnnn");
  using Frames = std::vector<std::uint64_t>;
  const std::map<std::string, Frames> expected{
      {"its .exr has another size than when it was written", {1}},
      {"its .png has another size than when it was written", {2}},
      {"its .exr has other content (SHA-256) than when it was written", {3}},
      {"its .png has other content (SHA-256) than when it was written", {4}},
      {"it has no complete line in frames.jsonl", {5}}};
  EXPECT_EQ(again.rejected(), expected);
}

// Lines of a previzd that wrote no hashes: what decodes is kept, and has its hash from then on.
TEST_F(RenderDirectoryTest, FilesOfAnOlderVersionAreDecoded) {
  const std::filesystem::path out = directory_ / "out";
  {
    RenderDirectory directory = open();
    std::string lines;
    for (const std::uint64_t frame : {0, 1, 2}) {
      directory.write(sample_shot(frame), set_);
      FinishedFrame old = *directory.finished(frame);
      old.files.clear();
      lines += to_json(old) + "\n";
    }
    write_content(out / "frames.jsonl", lines);
  }
  for (const char* name : {"0001.exr", "0002.png"}) halve(name);
  {
    const RenderDirectory again = open();
    EXPECT_EQ(finished(again, 2), "ynn");
    const std::map<std::string, std::vector<std::uint64_t>> expected{
        {"its .exr cannot be decoded", {1}}, {"its .png cannot be decoded", {2}}};
    EXPECT_EQ(again.rejected(), expected);
  }
  std::string bytes = content_of(out / "0000.exr");
  bytes.back() ^= 1;
  write_content(out / "0000.exr", bytes);
  EXPECT_EQ(open().finished(0), nullptr);
}

// What is outside of the range is neither read nor forgotten.
TEST_F(RenderDirectoryTest, FramesOutsideOfTheRangeKeepTheirLines) {
  write_frames(3);
  std::filesystem::resize_file(directory_ / "out/0000.png", 10);
  const RenderDirectory part(output_, settings, false, {}, {1, 2});
  EXPECT_TRUE(part.rejected().empty());
  EXPECT_EQ(open().rejected().size(), 1u);
}

TEST_F(RenderDirectoryTest, AStopEndsTheCheckAndChangesNothing) {
  open().write(sample_shot(0), set_);
  std::stop_source stop;
  stop.request_stop();
  const std::string lines = content_of(directory_ / "out/frames.jsonl");
  EXPECT_THROW(RenderDirectory(output_, settings, false, {}, all_frames, stop.get_token()), Error);
  EXPECT_EQ(content_of(directory_ / "out/frames.jsonl"), lines);
}

TEST_F(RenderDirectoryTest, OtherSettingsAreRefusedByNameUnlessForced) {
  open().write(sample_shot(0), set_);
  constexpr const char* other = R"({"samples": 64, "set": "another text"})";
  EXPECT_THAT(test::error_of([&] { open(other); }),
              AllOf(HasSubstr("render.json"), HasSubstr("samples is 16 there and 64 now"),
                    HasSubstr("set differs"), HasSubstr("--force")));
  EXPECT_EQ(open(other, true).finished(0), nullptr);
  EXPECT_NO_THROW(open(other));
}

TEST_F(RenderDirectoryTest, WithoutFinishedFramesOtherSettingsAreNoMatter) {
  open();
  EXPECT_NO_THROW(open(R"({"samples": 64})"));
}

// Two objects stand for two processes: the locks are of the open file, not of the process.
TEST_F(RenderDirectoryTest, TwoShareTheFramesAndLoseNoLine) {
  constexpr std::uint64_t count = 24;
  RenderDirectory first = open(), second = open();
  std::array<std::set<std::uint64_t>, 2> written;
  const auto work = [&](RenderDirectory& directory, std::set<std::uint64_t>& own) {
    for (std::uint64_t frame = 0; frame < count; ++frame) {
      if (directory.claim({frame}).empty()) continue;
      own.insert(frame);
      directory.write(sample_shot(frame), set_);
    }
  };
  {
    const std::jthread other([&] { work(first, written[0]); });
    work(second, written[1]);
  }
  EXPECT_EQ(written[0].size() + written[1].size(), count);  // none twice, none left out
  std::istringstream lines(content_of(directory_ / "out/frames.jsonl"));
  std::set<std::uint64_t> found;
  for (std::string line; std::getline(lines, line);)
    EXPECT_TRUE(found.insert(from_json(line).frame).second) << line;
  EXPECT_EQ(found.size(), count);
}

TEST_F(RenderDirectoryTest, WhatAnotherHasIsNamedWithWho) {
  RenderDirectory first = open();
  EXPECT_EQ(first.claim({7, 12}).size(), 2u);
  RenderDirectory second = open();
  EXPECT_THAT(second.notes(), ElementsAre(HasSubstr("also at work here: previzd")));
  EXPECT_THAT(second.claim({7, 8}), ElementsAre(8));
  const auto held = second.at_others({7, 8, 9, 12});
  ASSERT_EQ(held.size(), 1u);
  EXPECT_EQ(held.begin()->second, (std::vector<std::uint64_t>{7, 12}));
  std::array<char, 256> host{};
  ::gethostname(host.data(), host.size() - 1);
  EXPECT_THAT(held.begin()->first, StartsWith("previzd " + std::to_string(::getpid()) +
                                              " on host " + host.data() + ", since 20"));
  first.write(sample_shot(7), set_);
  first.release(12);
  EXPECT_THAT(second.claim({7, 12}), ElementsAre(12));
}

TEST_F(RenderDirectoryTest, ARunOfFramesIsTakenAsFarAsItIsFree) {
  RenderDirectory first = open(), second = open();
  first.write(sample_shot(2), set_);
  EXPECT_EQ(first.claim({4, 5}), (std::set<std::uint64_t>{4, 5}));
  EXPECT_EQ(second.claim({2, 3, 4, 6}), (std::set<std::uint64_t>{3, 6}));
  EXPECT_EQ(first.claim({3, 6}), std::set<std::uint64_t>{});
  EXPECT_EQ(first.claim({6, 7, 8, 9}, 2), (std::set<std::uint64_t>{7, 8}));
  EXPECT_EQ(second.claim({9, 10}), (std::set<std::uint64_t>{9, 10}));
}

// The other process holds a frame, is in the middle of a picture and of a line, and is killed.
TEST_F(RenderDirectoryTest, FramesOfAKilledProcessAreFreeAgain) {
  RenderDirectory directory = open();
  directory.write(sample_shot(0), set_);
  test::ChildProcess child([&](int tells) {
    RenderDirectory other = open();
    const bool is_claimed = other.claim({3}).contains(3);
    const session::Draft draft(directory_ / "out/0003.exr");
    std::ofstream(directory_ / "out/frames.jsonl", std::ios::app) << R"({"frame":3,"ti)";
    test::tell(tells, is_claimed);
    for (;;) ::pause();
  });
  bool is_claimed = false;
  ASSERT_TRUE(child.is_told(is_claimed));
  EXPECT_TRUE(is_claimed);
  EXPECT_TRUE(directory.claim({3}).empty());
  EXPECT_EQ(directory.at_others({3}).size(), 1u);
  child.kill();

  EXPECT_TRUE(directory.at_others({3}).empty());
  EXPECT_THAT(directory.claim({3}), ElementsAre(3));
  directory.write(sample_shot(3), set_);  // its line must not run into the half one
  const RenderDirectory again = open();
  EXPECT_NE(again.finished(0), nullptr);
  EXPECT_NE(again.finished(3), nullptr);
  ASSERT_EQ(again.notes().size(), 2u);
  EXPECT_THAT(again.notes()[0], HasSubstr(".0003.exr."));
}

TEST_F(RenderDirectoryTest, OtherSettingsAreRefusedWhileAnotherIsAtWorkEvenIfForced) {
  constexpr const char* other = R"({"samples": 64, "set": "another text"})";
  RenderDirectory running = open();  // and has finished nothing yet
  EXPECT_THROW(open(other), Error);
  EXPECT_THROW(open(other, true), Error);
  running.write(sample_shot(0), set_);
  const RenderDirectory forced = open(settings, true);  // would take from it what it has finished
  EXPECT_NE(forced.finished(0), nullptr);
  EXPECT_THAT(forced.notes().back(), HasSubstr("--force is ignored"));
}

TEST_F(RenderDirectoryTest, ForceOfAFewFramesKeepsTheLinesOfTheOthers) {
  write_frames(3);
  { const RenderDirectory forced(output_, settings, true, {}, {1, 1}); }
  EXPECT_EQ(finished(open(), 2), "yny");
}

TEST_F(RenderDirectoryTest, NothingIsWrittenThroughALink) {
  write_content(directory_ / "elsewhere", "mine");
  for (const char* name : {"frames.jsonl", "render.json", "render.lock"}) {
    std::filesystem::remove_all(directory_ / "out");
    std::filesystem::create_directory(directory_ / "out");
    std::filesystem::create_symlink("../elsewhere", directory_ / "out" / name);
    EXPECT_THROW(open(), Error) << name;
  }
  std::filesystem::remove_all(directory_ / "out");
  {
    RenderDirectory directory = open();
    directory.write(sample_shot(0), set_);
    std::filesystem::rename(directory_ / "out/frames.jsonl", directory_ / "lines");
    std::filesystem::create_symlink("../lines", directory_ / "out/frames.jsonl");
    EXPECT_THROW(directory.write(sample_shot(1), set_), Error);
    std::filesystem::rename(directory_ / "lines", directory_ / "out/frames.jsonl");
  }
  for (const char* name : {"0001.exr", "0001.png"})  // of the frame whose line was refused
    std::filesystem::remove(directory_ / "out" / name);
  // A picture that is a link to the very same bytes elsewhere is rendered again, in its place.
  std::filesystem::rename(directory_ / "out/0000.png", directory_ / "picture");
  std::filesystem::create_symlink("../picture", directory_ / "out/0000.png");
  const std::string before = content_of(directory_ / "picture");
  RenderDirectory again = open();
  ASSERT_EQ(again.rejected().size(), 1u);
  EXPECT_THAT(again.rejected().begin()->first, StartsWith("its .png is a link"));
  pipeline::Shot shot = sample_shot(0);
  shot.picture =
      std::make_shared<const Plate>(Plate{8, 6, 8, std::vector<std::uint16_t>(3 * 8 * 6, 7)});
  again.write(shot, set_);
  EXPECT_FALSE(std::filesystem::is_symlink(directory_ / "out/0000.png"));
  EXPECT_EQ(content_of(directory_ / "picture"), before);
  EXPECT_EQ(content_of(directory_ / "elsewhere"), "mine");
}

// Lines count whose bytes are locked; a file of a million others is made small.
TEST(FolderLocks, LinesThatNobodyHoldsAreNotLookedAt) {
  const test::TemporaryDirectory directory;
  const std::filesystem::path file = directory / FolderLocks::file_name;
  std::ofstream(file) << std::string(1'000'000, '\n');
  static int calls;
  calls = 0;
  const auto counted = [](int descriptor, int command, struct flock* range) {
    ++calls;
    return call_fcntl(descriptor, command, range);
  };
  FolderLocks one(directory.path(), counted), two(directory.path(), counted),
      three(directory.path(), counted);
  for (FolderLocks* locks : {&one, &two, &three}) {
    const FolderLocks::Transaction transaction(*locks);
    locks->join();
  }
  EXPECT_EQ(one.claim({5}, 1).size(), 1u);
  const std::vector<FolderUser> others = three.others();
  ASSERT_EQ(others.size(), 2u);
  EXPECT_EQ(others[0].pid, ::getpid());
  EXPECT_THAT(others[0].frames, ElementsAre(5));
  EXPECT_LT(std::filesystem::file_size(file), 1000u);
  EXPECT_LT(calls, 100);
}

TEST(FrameRange, ReadsWhatTheHelpSays) {
  EXPECT_EQ(parse_frame_range("7").first, 7u);
  EXPECT_EQ(parse_frame_range("7").last, 7u);
  EXPECT_EQ(parse_frame_range("3-9").first, 3u);
  EXPECT_EQ(parse_frame_range("3-9").last, 9u);
  EXPECT_GT(parse_frame_range("3-").last, 1'000'000'000u);
  for (const char* wrong : {"", "-", "a", "3-b", "9-3", "3--9", "-3", " 3", "3 - 9"})
    EXPECT_THROW(parse_frame_range(wrong), Error) << wrong;
}

}  // namespace previz::post::render_directory_test
