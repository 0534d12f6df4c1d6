// Which set runs, from files alone, without a rig.
#include "daemon/rig/set_keeper.hpp"

#include <sys/stat.h>

#include "tests/support/content_of.hpp"
#include "tests/support/full_disk.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wait_until.hpp"

namespace previz::rig::set_keeper_test {

using testing::Optional;

// Waits until what was begun has ended. Returns why it came to nothing, if it did.
std::optional<std::string> ended(SetKeeper& sets) {
  const std::optional<SetKeeper::Ended> ended = sets.finish(test::longest_wait);
  EXPECT_TRUE(ended) << "it never ended";
  return ended ? ended->why_not : std::nullopt;
}
std::optional<std::string> change(SetKeeper& sets, int next) {
  sets.begin_change(next);
  return ended(sets);
}
std::optional<std::string> keep(SetKeeper& sets, const pipeline::Edits& edits) {
  sets.begin_keep(edits);
  return ended(sets);
}

// Looks at the file once, which a thread does.
void look(SetKeeper& sets) {
  ASSERT_TRUE(test::wait_until("it has looked", [&] { return sets.look_at_file(); }));
}

class SetKeeperTest : public testing::Test {
 protected:
  void write(const std::string& file, const std::string& text) {
    std::ofstream(folder_ / file) << text;
    const auto time = std::filesystem::last_write_time(folder_ / file);
    std::filesystem::last_write_time(folder_ / file, time + std::chrono::seconds(++writes_));
  }
  SetKeeper keeper_of(const std::string& text) {
    write("b.toml", text);
    return keeper();
  }
  SetKeeper keeper() {
    return {folder_ / "b.toml", [](set::Set& set) { set.quality.samples = 7; }, reports_};
  }
  bool says(const std::string& words) const { return log_.str().find(words) != std::string::npos; }

  test::TemporaryDirectory folder_;
  std::ostringstream log_;
  report::Reports reports_{report::lines_to(log_)};
  int writes_ = 0;
};

TEST_F(SetKeeperTest, ChangesToTheNeighbourAndRoundTheEndWithTheSameOverrides) {
  for (const char* name : {"a", "b", "c"})
    write(name + std::string(".toml"), "set.name = \"" + std::string(name) + "\"\n");
  SetKeeper sets = keeper();
  EXPECT_EQ(sets.running().set.name, "b");
  for (const char* expected : {"c", "a", "b"}) {
    EXPECT_EQ(change(sets, 1), std::nullopt);
    ASSERT_TRUE(sets.has_next());
    sets.begin_next();
    EXPECT_FALSE(sets.has_next());
    EXPECT_EQ(sets.running().set.name, expected);
    EXPECT_EQ(sets.running().set.quality.samples, 7);
  }
  change(sets, -1);
  sets.begin_next();
  EXPECT_EQ(sets.running().set.name, "a");
}

TEST_F(SetKeeperTest, ASetWithAFaultLeavesTheOldOneAndSaysWhy) {
  SetKeeper sets = keeper_of("set.name = \"good\"\n");
  write("b.toml", "set.name = 3\n");
  const std::optional<std::string> why_not = change(sets, 0);
  ASSERT_TRUE(why_not);
  EXPECT_THAT(*why_not, AllOf(StartsWith("the old set stays in use: "),
                              HasSubstr("b.toml:1:12: set.name: "), Not(HasSubstr("\n"))));
  EXPECT_FALSE(sets.has_next());
  EXPECT_EQ(sets.running().set.name, "good");
  EXPECT_TRUE(says("\nthe old set stays in use\n")) << log_.str();
  ASSERT_EQ(reports_.troubles().size(), 1u);
  EXPECT_EQ(line_of(reports_.troubles()[0]), *why_not);
  EXPECT_THAT(sets.problem(), HasSubstr("b.toml:1:12: set.name: "));
  write("b.toml", "set.name = \"good again\"\n");
  EXPECT_EQ(change(sets, 0), std::nullopt);
  sets.begin_next();
  EXPECT_EQ(sets.problem(), "");
  write("b.toml", "set.name = 3\n");
  EXPECT_THROW(keeper(), Error);
}

TEST_F(SetKeeperTest, AFileThatHasChangedAndRestsIsReadAgain) {
  SetKeeper sets = keeper_of("set.name = \"old\"\n");
  look(sets);
  write("b.toml", "set.name = \"new\"\n");
  look(sets);
  EXPECT_FALSE(sets.is_reading());  // it may still be being written
  look(sets);
  ASSERT_TRUE(sets.is_reading());
  EXPECT_EQ(ended(sets), std::nullopt);
  ASSERT_TRUE(sets.has_next());
  EXPECT_TRUE(says("b.toml: the file has changed")) << log_.str();
  sets.begin_next();
  EXPECT_EQ(sets.running().set.name, "new");
  look(sets);
  look(sets);
  EXPECT_FALSE(sets.is_reading());
  EXPECT_FALSE(sets.has_next());
}

TEST_F(SetKeeperTest, ReadsNoPipe) {
  SetKeeper sets = keeper_of("set.name = \"old\"\n");
  std::filesystem::remove(folder_ / "b.toml");
  ASSERT_EQ(mkfifo((folder_ / "b.toml").c_str(), 0600), 0);
  const std::optional<std::string> why_not = change(sets, 0);
  EXPECT_THAT(why_not, Optional(HasSubstr("is a pipe and not a set file")));
  EXPECT_EQ(sets.running().set.name, "old");
}

TEST_F(SetKeeperTest, AChangedSetThatIsDroppedIsReadAgain) {
  SetKeeper sets = keeper_of("set.name = \"old\"\n");
  write("b.toml", "set.name = \"new\"\n");
  for (int times = 0; times < 2; ++times) {
    look(sets);
    EXPECT_FALSE(sets.is_reading());
    look(sets);
    ASSERT_TRUE(sets.is_reading());
    EXPECT_EQ(ended(sets), std::nullopt);
    EXPECT_EQ(sets.drop_next("a take runs"), "the old set stays in use: a take runs");
    EXPECT_FALSE(sets.has_next());
  }
  EXPECT_TRUE(says("the old set stays in use: a take runs\n")) << log_.str();
}

constexpr const char* stage = R"(# The desk.
[[light]]  # over the table
name = "key"
type = "point"
position_m = [0, 0, 1]
emission = [1, 1, 1]
gain_mixed = 0.5   # half
)";

pipeline::Edits a_stop_down(const std::string& lamp) {
  pipeline::Edits edits;
  edits.lights[lamp].stops = -1;
  return edits;
}

TEST_F(SetKeeperTest, ChangesOutlastTheSameFileAndNoOther) {
  write("b.toml", stage);
  write("c.toml", stage);
  SetKeeper sets = keeper();
  EXPECT_EQ(sets.edits(), pipeline::Edits{});
  pipeline::Edits edits = a_stop_down("key");
  edits.lights["gone"].stops = 1;
  edits.objects["vase"].scale = 2;
  change(sets, 0);
  sets.leave(edits);
  sets.begin_next();
  EXPECT_EQ(sets.edits(), a_stop_down("key"));
  EXPECT_TRUE(says("\"gone\" was changed by buttons but is no longer in the set"));
  EXPECT_TRUE(says("\"vase\" was changed by buttons but is no longer in the set"));
  change(sets, 1);
  sets.begin_next();
  EXPECT_EQ(sets.edits(), pipeline::Edits{});
}

TEST_F(SetKeeperTest, KeepsChangesInTheFileAndTheOldOneBesideIt) {
  SetKeeper sets = keeper_of(stage);
  constexpr std::filesystem::perms of_owner_and_group{0620};
  std::filesystem::permissions(folder_ / "b.toml", of_owner_and_group);
  ASSERT_EQ(keep(sets, a_stop_down("key")), std::nullopt);
  EXPECT_EQ(std::filesystem::status(folder_ / "b.toml").permissions(), of_owner_and_group);
  std::string expected = stage;
  expected.replace(expected.find("0.5 "), 4, "0.25 ");
  EXPECT_EQ(test::content_of(folder_ / "b.toml"), expected);
  EXPECT_EQ(test::content_of(folder_ / "b.toml.1.old"), stage);
  ASSERT_TRUE(sets.has_next());
  sets.leave(a_stop_down("key"));
  sets.begin_next();
  EXPECT_EQ(sets.edits(), pipeline::Edits{}) << "changed twice";
  EXPECT_EQ(sets.running().set.lights[0].gain_mixed, 0.25);
  ASSERT_EQ(keep(sets, a_stop_down("key")), std::nullopt);
  EXPECT_EQ(test::content_of(folder_ / "b.toml.1.old"), stage);
  EXPECT_EQ(test::content_of(folder_ / "b.toml.2.old"), expected);
}

// The set could not start: what the crew has placed in the old one is still there.
TEST_F(SetKeeperTest, GoesBackWithItsChanges) {
  write("b.toml", stage);
  write("c.toml", "");
  SetKeeper sets = keeper();
  EXPECT_FALSE(sets.go_back("there is no camera"));  // nothing ran before the first one
  ASSERT_EQ(change(sets, 1), std::nullopt);
  sets.leave(a_stop_down("key"));
  sets.begin_next();
  EXPECT_EQ(sets.edits(), pipeline::Edits{});
  ASSERT_TRUE(sets.go_back("there is no camera"));
  EXPECT_TRUE(says("there is no camera\nback to the previous set: ")) << log_.str();
  EXPECT_EQ(sets.edits(), a_stop_down("key"));
  EXPECT_EQ(sets.problem(), "there is no camera");
  EXPECT_FALSE(sets.go_back("nor is there one now"));
}

// The set with the changes could not start, and its file was read again later, changed by hand.
TEST_F(SetKeeperTest, ChangesInTheFileAreNotMadeTwice) {
  SetKeeper sets = keeper_of(stage);
  ASSERT_EQ(keep(sets, a_stop_down("key")), std::nullopt);
  sets.leave(a_stop_down("key"));
  sets.begin_next();
  ASSERT_TRUE(sets.go_back("there is no camera"));
  EXPECT_EQ(sets.edits(), a_stop_down("key")) << "the running set does not have them";
  write("b.toml", test::content_of(folder_ / "b.toml") + "# by hand\n");
  ASSERT_EQ(change(sets, 0), std::nullopt);
  sets.leave(a_stop_down("key"));
  sets.begin_next();
  EXPECT_EQ(sets.edits(), pipeline::Edits{});
  EXPECT_FALSE(says("is dropped"));
}

TEST_F(SetKeeperTest, ChangesThatComeToNothingAreNotWritten) {
  SetKeeper sets = keeper_of(stage);
  pipeline::Edits edits;
  edits.lights["key"].stops = 0;
  const std::optional<std::string> why_not = keep(sets, edits);
  EXPECT_THAT(why_not, Optional(HasSubstr("have no effect")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "b.toml.1.old"));
}

TEST_F(SetKeeperTest, KeepsNothingOverAChangedFile) {
  SetKeeper sets = keeper_of(stage);
  write("b.toml", std::string(stage) + "# by hand\n");
  const std::optional<std::string> why_not = keep(sets, a_stop_down("key"));
  EXPECT_THAT(why_not, Optional(HasSubstr("has changed since it was loaded")));
  EXPECT_EQ(test::content_of(folder_ / "b.toml"), std::string(stage) + "# by hand\n");
  EXPECT_FALSE(sets.has_next());
}

TEST_F(SetKeeperTest, KeepsNothingWhereItMayNotWrite) {
  SetKeeper sets = keeper_of(stage);
  std::optional<std::string> why_not;
  {
    const test::FileSizeLimit full(0);
    why_not = keep(sets, a_stop_down("key"));
  }
  EXPECT_THAT(why_not, Optional(AllOf(HasSubstr("not kept: "), HasSubstr("b.toml"))));
  EXPECT_EQ(test::content_of(folder_ / "b.toml"), stage);
  EXPECT_FALSE(sets.has_next());
}

TEST(SetFileWatch, WaitsUntilAFileIsWritten) {
  const SetFileWatch::Time start{};
  const auto at = [&](int second) { return start + std::chrono::seconds(second); };
  SetFileWatch watch(start);
  EXPECT_FALSE(watch.is_changed(start));
  EXPECT_FALSE(watch.is_changed(at(1)));  // just changed
  EXPECT_FALSE(watch.is_changed(at(2)));  // and once more
  EXPECT_TRUE(watch.is_changed(at(2)));
  EXPECT_FALSE(watch.is_changed(at(2)));  // reported once
  EXPECT_FALSE(watch.is_changed(start));  // an older file put in its place
  EXPECT_TRUE(watch.is_changed(start));
}

}  // namespace previz::rig::set_keeper_test
