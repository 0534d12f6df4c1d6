// A take comes from elsewhere: whatever lies in its folder, nobody else's file is read or written,
// nobody waits for ever, and what is no file is named.
#include <sys/stat.h>

#include "daemon/core/output/salvage.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/session/draft.hpp"
#include "daemon/core/session/summary.hpp"
#include "daemon/tools/post/takes.hpp"
#include "tests/support/child_process.hpp"
#include "tests/support/content_of.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::post::hostile_take_test {

namespace fs = std::filesystem;

// What may stand in the place of a take's file.
struct Stranger {
  const char* name;
  std::function<void(const fs::path& place, const fs::path& victim)> put;
};

const Stranger strangers[] = {
    {"link",
     [](const fs::path& place, const fs::path& victim) { fs::create_symlink(victim, place); }},
    {"device",
     [](const fs::path& place, const fs::path&) { fs::create_symlink("/dev/zero", place); }},
    {"pipe", [](const fs::path& place, const fs::path&) { ::mkfifo(place.c_str(), 0600); }},
    {"folder", [](const fs::path& place, const fs::path&) { fs::create_directory(place); }},
};
const char* const files[] = {"session.toml", "observer.mkv",    "observer.jsonl",
                             "light.mkv",    "light.jsonl",     "composite.mkv",
                             "track.jsonl",  "composite.jsonl", "events.jsonl"};

struct Case {
  const char* file;
  const Stranger* stranger;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const char* file : files)
    for (const Stranger& stranger : strangers) all.push_back({file, &stranger});
  return all;
}

// What a command says, with the error that it ends with.
std::string said(const std::function<void(std::ostream&)>& command) {
  std::ostringstream out;
  const std::string error = test::error_of([&] { command(out); });
  return out.str() + error;
}

class HostileTake : public testing::TestWithParam<Case> {
 protected:
  HostileTake() {
    test::write_small_take(directory_.path());
    fs::create_directories(folder_);
    fs::rename(directory_ / "session", take_);
    std::ofstream(victim_) << victims_text;
    ::chmod(victim_.c_str(), 0600);
  }

  void put_stranger() {
    fs::remove_all(take_ / GetParam().file);
    GetParam().stranger->put(take_ / GetParam().file, victim_);
  }

  void expect_victim_untouched() {
    EXPECT_EQ(test::content_of(victim_), victims_text);
    EXPECT_EQ(fs::status(victim_).permissions(), fs::perms{0600});
  }

  static constexpr const char* victims_text = "as it was";
  test::TemporaryDirectory directory_;
  const fs::path folder_ = directory_ / "takes", take_ = folder_ / "12A_take001",
                 victim_ = directory_ / "victim", disk_ = directory_ / "disk";
};

TEST_P(HostileTake, IsNamedAndHarmsNobody) {
  put_stranger();
  const std::string name = GetParam().file;
  EXPECT_THAT(said([&](std::ostream& out) { list_takes({folder_}, out); }), HasSubstr(name));
  EXPECT_THAT(said([&](std::ostream& out) { EXPECT_NE(check_takes({take_}, out, {}), 0); }),
              HasSubstr(name));
  said([&](std::ostream& out) { mark_takes({take_}, true, out); });
  EXPECT_THAT(said([&](std::ostream& out) {
                copy_takes({{take_}, disk_}, out, {});
              }),
              HasSubstr(name));
  if (name.starts_with("observer")) {
    EXPECT_THAT(said([&](std::ostream&) { pipeline::open_take(take_, std::nullopt); }),
                HasSubstr(name));
  }
  EXPECT_TRUE(!fs::exists(disk_) || fs::is_empty(disk_)) << "a copy that is not whole";
  expect_victim_untouched();
}

// The daemon brings takes that were cut off into order as it starts.
TEST_P(HostileTake, IsNoTrapForADaemonThatStarts) {
  const fs::path toml = take_ / "session.toml";
  std::string text = test::content_of(toml);
  const std::string closed = "closed = true";
  session::replace_file(toml, text.replace(text.find(closed), closed.size(), "closed = false"));
  put_stranger();
  fs::create_symlink(victim_, take_ / "session.toml.part");  // where drafts once were
  fs::create_symlink(victim_, folder_ / ".recording");
  std::vector<std::string> salvaged;
  output::Salvage({folder_}, [](const std::string&) {}).look(salvaged);
  expect_victim_untouched();
}

INSTANTIATE_TEST_SUITE_P(Holds, HostileTake, testing::ValuesIn(cases()), [](const auto& name) {
  std::string words = std::string(name.param.file) + "_" + name.param.stranger->name;
  std::ranges::replace(words, '.', '_');
  return words;
});

// Returns what the action says to somebody who is not root, from whom no folder is kept.
std::string said_to_nobody(const std::function<void(std::ostream&)>& action) {
  return test::text_of_child([&] {
    if (::geteuid() == 0 && ::setuid(65534) != 0) ::_exit(1);
    return "said: " + said(action);
  });
}

// A folder of takes that belongs to somebody else is no empty one.
TEST(TakesList, NamesATakeThatMayNotBeRead) {
  const test::TemporaryDirectory directory;
  const fs::path take = directory / "takes/12A_take001";
  fs::create_directories(take);
  std::ofstream(take / "session.toml") << "format_version = 3\n";
  fs::permissions(directory.path(), fs::perms{0755});
  fs::permissions(take, fs::perms{0});
  const std::string said =
      said_to_nobody([&](std::ostream& out) { list_takes({directory / "takes"}, out); });
  fs::permissions(take, fs::perms{0755});
  EXPECT_THAT(said, HasSubstr("12A_take001"));
  EXPECT_THAT(said, HasSubstr("Permission denied"));
}

// The uppermost folder of a disk of its own has folders of root and of desktops, which only these
// may look into.
TEST(TakesList, PassesOverWhatTheDiskKeepsForItself) {
  const test::TemporaryDirectory directory;
  const fs::path disk = directory / "disk";
  for (const char* name : {"lost+found", ".Trash-1000"}) {
    fs::create_directories(disk / name);
    fs::permissions(disk / name, fs::perms{0});
  }
  fs::permissions(directory.path(), fs::perms{0755});
  const std::string said = said_to_nobody([&](std::ostream& out) {
    list_takes({disk}, out);
    std::vector<std::string> salvaged;
    output::Salvage({disk}, [&](const std::string& what) { out << what; }).look(salvaged);
  });
  EXPECT_THAT(said,
              AllOf(StartsWith("said: "), Not(HasSubstr("lost+found")), Not(HasSubstr("Trash"))));
}

// What a copy that was killed left goes with the next one.
TEST(TakesCopy, RemovesWhatADeadCopyLeft) {
  const test::TemporaryDirectory directory;
  test::write_small_take(directory.path());
  const fs::path disk = directory / "disk";
  fs::create_directories(disk);
  test::text_of_child([&]() -> std::string {
    const session::DraftFolder draft(disk / "session");
    std::ofstream(draft.path() / "observer.mkv") << "half of it";
    ::_exit(1);
  });
  EXPECT_EQ(std::distance(fs::directory_iterator(disk), {}), 1);
  std::ostringstream out;
  copy_takes({{directory / "session"}, disk}, out, {});
  EXPECT_EQ(std::distance(fs::directory_iterator(disk), {}), 1) << "the copy alone";
  EXPECT_TRUE(fs::exists(disk / "session/observer.mkv"));
}

}  // namespace previz::post::hostile_take_test
