// Drafts are nobody else's files, and those of dead processes go.
#include "daemon/core/session/draft.hpp"

#include <sys/stat.h>

#include "daemon/core/session/session.hpp"
#include "tests/support/child_process.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::session::session_draft_test {

namespace fs = std::filesystem;

std::ptrdiff_t files_in(const test::TemporaryDirectory& folder) {
  return std::distance(fs::directory_iterator(folder.path()), {});
}

unsigned mode_of(const fs::path& file) {
  return static_cast<unsigned>(fs::status(file).permissions());
}

TEST(Draft, IsNotThereUntilItIsPut) {
  const test::TemporaryDirectory directory;
  const fs::path file = directory / "a.exr";
  {
    Draft draft(file);
    draft.file().append("half of it");
    EXPECT_FALSE(fs::exists(file));
  }
  EXPECT_EQ(files_in(directory), 0);
  Draft draft(file);
  draft.file().append("whole");
  draft.put();
  EXPECT_EQ(test::content_of(file), "whole");
  EXPECT_EQ(files_in(directory), 1);
}

TEST(Draft, OfANameThatIsAsLongAsNamesMayBe) {
  const test::TemporaryDirectory directory;
  const fs::path file = directory / std::string(255, 'a');
  replace_file(file, "whole");
  EXPECT_EQ(test::content_of(file), "whole");
}

TEST(Draft, TakesNoNameThatIsTaken) {
  const test::TemporaryDirectory directory;
  replace_file(directory / "1", "old");
  Draft draft(directory / "any");
  draft.file().append("new");
  EXPECT_FALSE(draft.put_as_new(directory / "1"));
  EXPECT_TRUE(draft.put_as_new(directory / "2"));
  EXPECT_EQ(test::content_of(directory / "1"), "old");
  EXPECT_EQ(test::content_of(directory / "2"), "new");
  EXPECT_EQ(files_in(directory), 2);
}

// Whatever lies in the folder: what a link leads to is neither written nor given another mode.
TEST(Draft, FollowsNoLink) {
  const test::TemporaryDirectory directory, elsewhere;
  const fs::path victim = elsewhere / "victim";
  std::ofstream(victim) << "as it was";
  ASSERT_EQ(::chmod(victim.c_str(), 0600), 0);
  fs::create_symlink(victim, directory / "a.toml.part");
  fs::create_symlink(victim, directory / "a.toml");
  replace_file(directory / "a.toml", "new");
  EXPECT_EQ(test::content_of(victim), "as it was");
  EXPECT_EQ(mode_of(victim), 0600u);
  EXPECT_EQ(read_plain_file(directory / "a.toml", {"a text", 1 << 20}), "new");
}

TEST(Draft, KeepsTheModeOfWhatItReplaces) {
  const test::TemporaryDirectory directory;
  const fs::path file = directory / "a.toml";
  replace_file(file, "old");
  ASSERT_EQ(::chmod(file.c_str(), 0640), 0);
  replace_file(file, "new");
  EXPECT_EQ(mode_of(file), 0640u);
}

// A process makes a file and a folder, and is killed.
TEST(Draft, OfADeadProcessIsRemovedAndNoOther) {
  const test::TemporaryDirectory directory;
  test::ChildProcess child([&](int tells) {
    const Draft draft(directory / "0001.exr");
    const DraftFolder folder(directory / "K_take003");
    std::ofstream(folder.path() / "observer.mkv") << "some frames";
    test::tell(tells, true);
    for (;;) ::pause();
  });
  bool has_made_them = false;
  ASSERT_TRUE(child.is_told(has_made_them));
  const Draft own(directory / "own.exr");
  std::ofstream(directory / "frames.part") << "of somebody else";
  EXPECT_TRUE(remove_dead_drafts(directory.path()).empty()) << "the child lives";
  child.kill();
  EXPECT_EQ(remove_dead_drafts(directory.path()).size(), 2u);
  EXPECT_EQ(files_in(directory), 2);
  EXPECT_TRUE(fs::exists(own.path()));
}

TEST(DraftFolder, GetsItsNameWhereNothingIs) {
  const test::TemporaryDirectory directory;
  DraftFolder first(directory / "take"), second(directory / "take/");
  std::ofstream(first.path() / "a") << "first";
  first.put();
  EXPECT_TRUE(fs::exists(directory / "take/a"));
  EXPECT_THROW(second.put(), Error);
}

// A user's file may be a link; what is no file is not waited for, and what is too large not read.
TEST(NamedFile, IsAFileOfItsKind) {
  const test::TemporaryDirectory directory;
  constexpr FileKind kind{"a text", 4096};
  replace_file(directory / "a", std::string(4096, 'a'));
  fs::create_symlink("a", directory / "link");
  fs::create_symlink("/dev/zero", directory / "device");
  ASSERT_EQ(::mkfifo((directory / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(read_file(directory / "link", kind).size(), 4096u);
  EXPECT_EQ(read_beginning(directory / "link", 3), "aaa");
  for (const auto& [name, words] : {std::pair("device", "is a device and not a text"),
                                    std::pair("pipe", "is a pipe and not a text")})
    EXPECT_THAT(test::error_of([&, &its = name] { read_file(directory / its, kind); }),
                HasSubstr(words));
  for (const std::uintmax_t size : {std::uintmax_t{4097}, std::uintmax_t{40} << 30}) {
    fs::resize_file(directory / "a", size);
    EXPECT_THAT(test::error_of([&] { read_file(directory / "a", kind); }),
                testing::EndsWith("a: is too large for a text, which has at most 4 KiB"));
  }
}

TEST(PlainLines, EndWithALineThatIsNone) {
  const test::TemporaryDirectory directory;
  const fs::path file = directory / "lines";
  const auto read = [&] {
    std::vector<std::string> all;
    PlainLines lines(file);
    for (std::string line; lines.next(line);) all.push_back(line);
    return all;
  };
  const std::string block((1 << 16) - 1, 'b');  // as much as is read at once, with its end
  std::ofstream(file) << "first\n\n" << block << "\n" << block << "\nlast";
  EXPECT_THAT(read(), ElementsAre("first", "", block, block, "last"));
  std::ofstream(file, std::ios::app) << "\n";
  EXPECT_THAT(read(), ElementsAre("first", "", block, block, "last"));
  std::ofstream(file) << "first\n" << std::string(3 << 20, '\0') << "\nlast\n";
  const std::vector<std::string> holed = read();  // as a disk leaves it whose sectors are bad
  ASSERT_EQ(holed.size(), 3u);
  EXPECT_LT(holed[1].size(), 2u << 20);
  EXPECT_EQ(holed[2], "last");
  std::ofstream(file) << "first\n\n" << block << "\n" << block << "\nlast\n";
  fs::resize_file(file, std::uintmax_t{40} << 30);
  const std::vector<std::string> cut = read();
  ASSERT_EQ(cut.size(), 6u);
  EXPECT_LT(cut.back().size(), 2u << 20);
}

std::string refusal(const fs::path& file) {
  return test::error_of([&] { read_plain_file(file, {"a text", 1 << 20}); });
}

TEST(PlainFile, IsNoLinkPipeDeviceOrFolder) {
  const test::TemporaryDirectory directory;
  replace_file(directory / "a", "text");
  EXPECT_EQ(read_plain_file(directory / "a", {"a text", 1 << 20}), "text");
  fs::create_symlink("a", directory / "link");
  fs::create_symlink("/dev/zero", directory / "device");
  fs::create_symlink("nothing", directory / "dangling");
  fs::create_directory(directory / "folder");
  ASSERT_EQ(::mkfifo((directory / "pipe").c_str(), 0600), 0);
  EXPECT_THAT(refusal(directory / "link"), HasSubstr("is a link (to a)"));
  EXPECT_THAT(refusal(directory / "device"), HasSubstr("is a link (to /dev/zero)"));
  EXPECT_THAT(refusal(directory / "dangling"), HasSubstr("is a link"));
  EXPECT_THAT(refusal(directory / "folder"), HasSubstr("is a folder"));
  EXPECT_THAT(refusal(directory / "pipe"), HasSubstr("is a pipe"));
  EXPECT_THAT(refusal("/dev/null"), HasSubstr("is a device"));
  EXPECT_THAT(refusal(directory / "missing"), HasSubstr("cannot be opened"));
}

// What a daemon does with the takes of the process before must not hit one that is being written.
TEST(Salvage, LeavesASessionAloneThatIsBeingWritten) {
  const test::TemporaryDirectory directory;
  const fs::path take = directory / "take";
  {
    SessionWriter writer(take, {});
    EXPECT_TRUE(is_being_written(take));
    EXPECT_FALSE(salvage(take));
    writer.close();
    EXPECT_FALSE(salvage(take));
  }
  EXPECT_FALSE(is_being_written(take));
  EXPECT_FALSE(salvage(take)) << "it is closed";
  fs::create_directory(directory / "empty");
  EXPECT_FALSE(salvage(directory / "empty"));
}

}  // namespace previz::session::session_draft_test
