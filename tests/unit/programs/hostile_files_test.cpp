// Whatever stands in the place of a file that a command reads: the command ends, with words, and
// asks for no more memory than such a file needs.
#include <sys/stat.h>

#include "tests/support/content_of.hpp"
#include "tests/support/program.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::hostile_files_test {

namespace fs = std::filesystem;

// What may stand in the place of a file.
struct Stranger {
  const char* name;
  void (*put)(const fs::path& place);
};

void put_pipe(const fs::path& place) {
  ASSERT_EQ(::mkfifo(place.c_str(), 0600), 0);
}
void put_device(const fs::path& place) {
  fs::create_symlink("/dev/zero", place);
}
void put_hole(const fs::path& place) {
  std::ofstream(place).close();
  fs::resize_file(place, std::uintmax_t{40} << 30);
}
void put_lines(const fs::path& place) {
  std::ofstream(place) << std::string(3'000'000, '\n');
}
constexpr Stranger pipe_{"Pipe", put_pipe}, device{"Device", put_device}, hole{"Hole", put_hole},
    lines{"Lines", put_lines};

class HostileFile : public testing::Test {
 protected:
  HostileFile() { test::write_small_take(directory_.path()); }

  // Runs a command in which TAKE, SET and FILE stand for their paths.
  test::Ended run(const std::string& command, const fs::path& file) {
    const bool is_of_the_rig = command.starts_with("check ") || command.starts_with("run ");
    std::vector<std::string> words{is_of_the_rig ? "daemon/previzd" : "daemon/previz"};
    std::istringstream parts(command);
    for (std::string word; parts >> word;) {
      if (word == "TAKE") word = directory_ / "session";
      if (word == "TAKES") word = directory_.path();
      if (word == "SET") word = directory_ / "set.toml";
      if (word == "FILE") word = file;
      if (word == "NEW") word = directory_ / "new";
      words.push_back(word);
    }
    return test::run_program(words);
  }

  test::TemporaryDirectory directory_;
};

// Named by whoever calls.
class NamedFile : public HostileFile, public testing::WithParamInterface<const char*> {};

TEST_P(NamedFile, IsRefusedByItsName) {
  for (const Stranger& stranger : {pipe_, device, hole}) {
    SCOPED_TRACE(stranger.name);
    const fs::path file = directory_ / (std::string("its.") + stranger.name);
    stranger.put(file);
    const test::Ended ended = run(GetParam(), file);
    EXPECT_FALSE(ended.ran_over);
    EXPECT_EQ(ended.status, 1) << ended.said;
    EXPECT_THAT(ended.said, HasSubstr(file.string()));
    EXPECT_LT(ended.said.size(), 2000u);
  }
}

INSTANTIATE_TEST_SUITE_P(
    OfEachCommand, NamedFile,
    testing::Values("check FILE", "run FILE --out NEW", "render TAKE --set FILE",
                    "render TAKE --with FILE", "track TAKE --set FILE",
                    "export TAKE NEW --set FILE", "farm TAKE --set FILE", "farm TAKE --with FILE",
                    "trade TAKE --set FILE", "trade FILE", "calibrate balance TAKE --set FILE",
                    "calibrate tags TAKE --set FILE", "calibrate from FILE", "import FILE NEW",
                    "model TAKE --set FILE", "model TAKE --parts FILE"),
    [](const auto& name) {
      std::string words;
      for (const char* c = name.param; *c != '\0'; ++c)
        if (std::isalpha(static_cast<unsigned char>(*c)) != 0) words += *c;
      return words;
    });

// In a take from elsewhere.
class FileOfATake : public HostileFile, public testing::WithParamInterface<const char*> {};

TEST_P(FileOfATake, IsReadNoFurtherThanItsKindGoes) {
  for (const Stranger& stranger : {hole, lines})
    for (const char* command : {"takes list TAKES", "takes check TAKE", "track TAKE"}) {
      SCOPED_TRACE(std::string(stranger.name) + ": " + command);
      fs::remove_all(directory_ / "new");
      const fs::path file = directory_ / "session" / GetParam();
      fs::remove_all(file);
      stranger.put(file);
      const test::Ended ended = run(command, file);
      EXPECT_FALSE(ended.ran_over);
      EXPECT_LT(ended.status, 128) << ended.said;
      EXPECT_THAT(ended.said, Not(HasSubstr("bad_alloc")));
      EXPECT_LT(ended.said.size(), 20'000u);
    }
}

INSTANTIATE_TEST_SUITE_P(Of, FileOfATake,
                         testing::Values("session.toml", "observer.jsonl", "light.jsonl",
                                         "track.jsonl", "events.jsonl", "SHA256SUMS"),
                         [](const auto& name) {
                           std::string words = name.param;
                           std::ranges::replace(words, '.', '_');
                           return words;
                         });

// In the folder of pictures that a render goes on in.
TEST_F(HostileFile, OfARenderIsReadNoFurtherThanItsKindGoes) {
  using Names = std::vector<const char*>;
  for (const Names& names : {Names{"render.json"}, Names{"frames.jsonl", "render.lock"}})
    for (const Stranger& stranger : {hole, lines}) {
      SCOPED_TRACE(std::string(stranger.name) + " in " + names[0]);
      const fs::path out = directory_ / "new";
      fs::remove_all(out);
      fs::create_directory(out);
      for (const char* name : names) stranger.put(out / name);
      const test::Ended ended = run("render TAKE --out NEW --spp 1 --frames 1-1 --no-png", {});
      EXPECT_FALSE(ended.ran_over);
      EXPECT_LT(ended.status, 2) << ended.said;
      EXPECT_THAT(ended.said, Not(HasSubstr("bad_alloc")));
    }
}

}  // namespace previz::hostile_files_test
