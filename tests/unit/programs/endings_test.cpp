// How commands end: with an error where what they say cannot be written, and soon after a signal.
#include <fmt/format.h>

#include <csignal>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "tests/support/content_of.hpp"
#include "tests/support/environment_variable.hpp"
#include "tests/support/program.hpp"
#include "tests/support/small_take.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::endings_test {

namespace fs = std::filesystem;

class Ending : public testing::Test {
 protected:
  Ending() { test::write_small_take(directory_.path()); }

  // TAKE, SET, PICTURES and NEW stand for their paths.
  std::vector<std::string> words_of(const std::string& command) const {
    std::vector<std::string> words;
    std::istringstream parts(command);
    for (std::string word; parts >> word;) {
      if (word == "TAKE") word = directory_ / "session";
      if (word == "SET") word = directory_ / "set.toml";
      if (word == "FOOTAGE_SET") word = directory_ / "footage.toml";
      if (word == "PICTURES") word = directory_ / "pictures";
      if (word == "JOB") word = directory_ / "job";
      if (word == "JSON") word = directory_ / "frames.json";
      if (word == "NEW") word = directory_ / "new/it";
      words.push_back(word);
    }
    return words;
  }

  // A set for pictures of 1280x720.
  void write_set_of_footage() {
    std::ofstream(directory_ / "footage.toml")
        << "[observer.intrinsics]\nwidth = 1280\nheight = 720\nfx = 1000\nfy = 1000\ncx = 639.5\n"
           "cy = 359.5\n[tracking]\nfamily = \"tag36h11\"\n[[tag]]\nid = 0\nsize_m = "
           "0.1\nposition_m = [0, 0, 0]\n";
  }

  // Footage that keeps a command busy for long: names of one picture of noise.
  void write_long_footage() {
    fs::create_directories(directory_ / "pictures");
    cv::Mat noise(720, 1280, CV_8UC3);
    cv::randu(noise, 0, 255);
    const fs::path first = directory_ / "pictures/00000.png";
    cv::imwrite(first, noise);
    nlohmann::json description{{"observer", {{"fps", 25}, {"start_ns", 0}, {"exposure", 1}}}};
    for (int i = 0; i < 5000; ++i) {
      const fs::path name = directory_ / fmt::format("pictures/{:05}.png", i);
      if (i > 0) fs::create_hard_link(first, name);
      description["observer"]["pictures"].push_back(name.string());
    }
    std::ofstream(directory_ / "frames.json") << description;
  }

  void make_job() {
    const test::Ended ended = test::run_program(
        {"daemon/previz", "farm", directory_ / "session", "--spp", "1000000", "--out",
         directory_ / "new/it", "--job", directory_ / "job", "--openjd", directory_ / "job.json"});
    ASSERT_EQ(ended.status, 0) << ended.said;
  }

  test::TemporaryDirectory directory_;
};

class FullOutput : public Ending, public testing::WithParamInterface<const char*> {};

TEST_P(FullOutput, IsAnError) {
  const test::Ended ended = test::run_program(words_of(GetParam()), {.output = "/dev/full"});
  EXPECT_EQ(ended.status, 1);
  EXPECT_THAT(ended.said, HasSubstr(": standard output cannot be written"));
}

std::string name_of(const char* command) {
  std::string words;
  for (const char* c = command; *c != '\0'; ++c)
    if (std::isalpha(static_cast<unsigned char>(*c)) != 0) words += *c;
  return words;
}

INSTANTIATE_TEST_SUITE_P(
    OfEachCommand, FullOutput,
    testing::Values("daemon/previzd --help", "daemon/previzd --version",
                    "daemon/previz takes list TAKE", "daemon/previz takes check TAKE",
                    "daemon/previzd check SET", "daemon/previzd devices --rules",
                    "daemon/previz farm TAKE --dry-run", "daemon/control/previzctl actions"),
    [](const auto& name) { return name_of(name.param); });

// Commands that are confined write where they were asked to, also by links and by names of their
// own. Each has a folder of its own for what it reads and makes, so that none is in reach by
// another name, and not in /tmp, where anybody may write.
TEST_F(Ending, ConfinedCommandsWriteWhereTheyWereAskedTo) {
  const fs::path folder = fs::path(PREVIZ_BINARY_DIR) / "tests/confined";
  fs::remove_all(folder);
  for (const char* made : {"home", "takes", "other_disk", "sets", "footage", "links"})
    fs::create_directories(folder / made);
  const test::EnvironmentVariable home("HOME", folder / "home");
  const test::EnvironmentVariable cache("XDG_CACHE_HOME", folder / "home/.cache");
  for (const char* take : {"takes/a", "other_disk/b"})
    fs::copy(directory_ / "session", folder / take, fs::copy_options::recursive);
  fs::create_directory_symlink("../other_disk/b", folder / "takes/b");
  for (const char* file : {"set.toml", "floor.gltf", "card.gltf"})
    fs::copy(directory_ / file, folder / "sets" / file);
  std::ofstream(folder / "sets/other.toml") << test::content_of(folder / "sets/set.toml")
                                            << "\n[output]\ndirectory = \"../by/the/set\"\n";
  cv::imwrite(folder / "footage/0.png", cv::Mat(36, 48, CV_8UC3, cv::Scalar(9, 9, 9)));
  std::ofstream(folder / "footage/frames.json")
      << R"({"observer": {"fps": 25, "start_ns": 0, "exposure": 1, "pictures": ["0.png"]}})";
  // Returns a link to a folder, whose own name nobody gives.
  const auto link_to = [&](const std::string& name) {
    fs::create_directories(folder / "behind" / name);
    fs::create_directory_symlink("../behind/" + name, folder / "links" / name);
    return folder / "links" / name;
  };
  const auto run = [&](std::vector<std::string> words) {
    words.insert(words.begin(), "daemon/previz");
    const test::Ended ended = test::run_program(words);
    EXPECT_EQ(ended.status, 0) << ended.said;
    EXPECT_THAT(ended.said, Not(HasSubstr("cannot be kept"))) << ended.said;
  };
  const fs::path take = folder / "takes/a", set = folder / "sets/set.toml";
  run({"import", folder / "footage/frames.json", folder / "new/a/take"});
  run({"import", folder / "footage/frames.json", link_to("import") / "take"});
  run({"export", take, link_to("export")});
  run({"export", take, folder / "exported/here"});
  run({"track", take, "--out", link_to("track") / "track.jsonl"});
  run({"render", take, "--spp", "1", "--frames", "1", "--out", folder / "rendered/here"});
  run({"render", take, "--spp", "1", "--frames", "1", "--set", folder / "sets/other.toml"});
  run({"render", folder / "takes", "--all", "--spp", "1", "--frames", "1", "--out",
       link_to("night")});
  run({"render", folder / "takes", "--all", "--spp", "1", "--frames", "2"});
  run({"takes", "mark", take});
  run({"takes", "copy", take, "--to", folder / "copies/here"});
  run({"calibrate", "lens", "--set", set, "--focal-length", "35", "--f-number", "2", "--focus", "2",
       "--sensor-width", "36", "--out", link_to("tables") / "lens.toml"});
  run({"farm", take, "--spp", "1", "--frames", "1", "--out", folder / "jobs/night", "--job",
       folder / "jobs/night.farm", "--openjd", folder / "night.json"});
  run({"farm", "task", folder / "jobs/night.farm", "0"});
  run({"farm", "finish", folder / "jobs/night.farm"});
  for (const char* made :
       {"home/.cache/previzd", "new/a/take/session.toml", "behind/import/take/session.toml",
        "behind/export/camera.usda", "exported/here/camera.usda", "behind/track/track.jsonl",
        "rendered/here/0001.png", "by/the/set/0001.png", "behind/night/b/0001.png",
        "other_disk/b/out/0002.png", "copies/here/a/session.toml", "behind/tables/lens.toml",
        "jobs/night/0001.png"})
    EXPECT_TRUE(fs::exists(folder / made)) << made;
  fs::remove_all(folder);
}

// Names and arguments are anybody's: none commands the terminal, forges a line or fills it.
TEST_F(Ending, WordsOfOthersAreShownAndNotObeyed) {
  const fs::path takes = directory_ / "takes";
  fs::create_directories(takes);
  fs::copy(directory_ / "session", takes / "1_take001\nK_take009  good\x1b[2J",
           fs::copy_options::recursive);
  const std::string escape = "x\x1b[31m", long_one(100'000, 'x');
  using Words = std::vector<std::string>;
  for (const Words& words :
       {Words{"daemon/previz", "takes", "list", takes.string()},
        Words{"daemon/previz", "takes", "check", (takes / "1_take001\nK_take009  good\x1b[2J")},
        Words{"daemon/previz", "takes", "list", escape},
        Words{"daemon/previz", "render", (directory_ / escape).string()},
        Words{"daemon/previz", "takes", "list", long_one},
        Words{"daemon/previz", "render", "--" + long_one, escape},
        Words{"daemon/control/previzctl", "action", escape},
        Words{"daemon/control/previzctl", "action", long_one},
        Words{"daemon/control/previzctl", long_one}}) {
    const test::Ended ended = test::run_program(words);
    EXPECT_FALSE(ended.said.empty());
    EXPECT_THAT(ended.said, Not(HasSubstr("\x1b")));
    EXPECT_THAT(ended.said, Not(HasSubstr("\nK_take009")));
    EXPECT_LT(ended.said.size(), 10'000u);
  }
}

TEST_F(Ending, NoLinesOfLibcameraComeBetweenThoseOfACommand) {
  const test::Ended ended = test::run_program({"daemon/previzd", "devices"});
  EXPECT_THAT(ended.said, AllOf(HasSubstr("cameras"), Not(HasSubstr("libcamera v")),
                                Not(HasSubstr("IPAManager"))));
}

TEST_F(Ending, ActionsAreATable) {
  const test::Ended ended = test::run_program({"daemon/control/previzctl", "actions"});
  EXPECT_THAT(ended.said, AllOf(HasSubstr("record"), Not(HasSubstr("\\x"))));
}

class CrashedCommand : public Ending, public testing::WithParamInterface<const char*> {};

// As if a library that reads for it crashed.
TEST_P(CrashedCommand, IsConfinedAndEndsWithALineAndWithoutHalfFiles) {
  write_long_footage();
  write_set_of_footage();
  fs::create_directories(directory_ / "new");
  const bool is_task = std::string(GetParam()).find("farm task") != std::string::npos;
  if (is_task) make_job();
  const test::Ended ended =
      test::run_program(words_of(GetParam()), {.signal = SIGSEGV,
                                               .signal_after = std::chrono::milliseconds(700),
                                               .signals_worker = true,
                                               .output = ""});
  EXPECT_FALSE(ended.ran_over);
  EXPECT_EQ(ended.status, is_task ? 75 : 1);
  EXPECT_THAT(ended.said, HasSubstr("previz: the command was stopped: Segmentation fault"));
  EXPECT_THAT(ended.worker_status, AllOf(HasSubstr("NoNewPrivs:\t1"), HasSubstr("Seccomp:\t2")));
  for (const auto& entry : fs::recursive_directory_iterator(directory_.path()))
    EXPECT_THAT(entry.path().string(), Not(HasSubstr(".part")));
  if (!is_task) return;
  EXPECT_THAT(test::content_of(directory_ / "job/state/0000.json"),
              AllOf(HasSubstr("\"machine\""), HasSubstr("Segmentation fault")));
}

INSTANTIATE_TEST_SUITE_P(
    OfEachCommand, CrashedCommand,
    testing::Values(
        "daemon/previz import JSON NEW",
        "daemon/previz model PICTURES --tags-only --set FOOTAGE_SET",
        "daemon/previz calibrate observer PICTURES --board charuco:11x8:20mm:15mm:5x5_1000",
        "daemon/previz render TAKE --spp 1000000 --out NEW", "daemon/previz trade TAKE --out NEW",
        "daemon/previz farm task JOB 0"),
    [](const auto& name) { return name_of(name.param); });

class StoppedCommand : public Ending, public testing::WithParamInterface<const char*> {};

TEST_P(StoppedCommand, EndsWithItsSignalAndWithoutHalfFiles) {
  write_long_footage();
  write_set_of_footage();
  fs::create_directories(directory_ / "new");
  if (std::string(GetParam()).find("JOB") != std::string::npos) make_job();
  static int tries = 0;  // both signals in turn
  const int signal = ++tries % 2 == 0 ? SIGINT : SIGTERM;
  const test::Ended ended = test::run_program(
      words_of(GetParam()),
      {.signal = signal, .signal_after = std::chrono::milliseconds(700), .output = ""});
  EXPECT_FALSE(ended.ran_over);
  EXPECT_EQ(ended.status, 128 + signal) << ended.seconds << " s: " << ended.said;
  const std::string command = GetParam();
  if (command.find("previz model ") != std::string::npos) {  // which looks for no stop
    EXPECT_LT(ended.seconds, 0.7 + 2);
  }
  for (const auto& entry : fs::recursive_directory_iterator(directory_.path()))
    EXPECT_THAT(entry.path().string(), Not(HasSubstr(".part")));
}

INSTANTIATE_TEST_SUITE_P(
    OfEachCommand, StoppedCommand,
    testing::Values(
        "daemon/previz import JSON NEW",
        "daemon/previz model PICTURES --tags-only --set FOOTAGE_SET",
        "daemon/previz calibrate observer PICTURES --board charuco:11x8:20mm:15mm:5x5_1000",
        "daemon/previz calibrate tags PICTURES --set FOOTAGE_SET",
        "daemon/previzd bench --seconds 60", "daemon/previz render TAKE --spp 1000000 --out NEW",
        "daemon/previz trade TAKE --out NEW", "daemon/previz farm task JOB 0"),
    [](const auto& name) { return name_of(name.param); });

}  // namespace previz::endings_test
