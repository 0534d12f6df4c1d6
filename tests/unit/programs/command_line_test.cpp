// What the command line leaves to the set file, and what it does not.
#include "daemon/command_line.hpp"

#include <CLI/CLI.hpp>

#include "daemon/core/program/options.hpp"
#include "daemon/former_commands.hpp"
#include "daemon/tools/command_line.hpp"
#include "tests/support/program.hpp"
#include "tests/support/test.hpp"

namespace previz::command_line_test {

template <class Said>
Said parsed_by(const std::string& arguments) {
  CLI::App app;
  Said said;
  add_commands(app, said);
  app.parse(arguments, false);
  return said;
}

tools::CommandLine parsed(const std::string& arguments) {
  return parsed_by<tools::CommandLine>(arguments);
}

post::RenderOptions render_options(const std::string& arguments) {
  return parsed("render session " + arguments).render;
}

rig::LiveOptions live_options(const std::string& arguments) {
  return parsed_by<CommandLine>("run set.toml " + arguments).run;
}

TEST(CommandLine, LeavesToTheSetWhatItDoesNotSay) {
  const post::RenderOptions options = render_options("");
  EXPECT_FALSE(options.samples);
  EXPECT_FALSE(options.adaptive);
  EXPECT_FALSE(options.denoise);
  EXPECT_FALSE(options.neighbours);
  EXPECT_FALSE(options.error);
  EXPECT_FALSE(options.seconds);
  EXPECT_FALSE(options.seed);
  EXPECT_FALSE(options.estimator);
  EXPECT_FALSE(options.directory);
}

TEST(CommandLine, ARunTakesItsSamplesFromTheSetOrAsItIsAsked) {
  EXPECT_FALSE(live_options("").samples);
  EXPECT_EQ(live_options("--spp 7").samples, 7);
  EXPECT_THROW(live_options("--spp 0"), CLI::ParseError);
  EXPECT_THROW(live_options("--spp many"), CLI::ParseError);
}

TEST(CommandLine, SettingsThatReplaceTheSetsAreAFile) {
  EXPECT_FALSE(live_options("").with);
  EXPECT_EQ(live_options("--with live.toml").with, "live.toml");
  EXPECT_EQ(render_options("--with post.toml").with, "post.toml");
}

TEST(CommandLine, SaysBothSidesOfAChoice) {
  EXPECT_EQ(render_options("--adaptive").adaptive, true);
  EXPECT_EQ(render_options("--even").adaptive, false);
  EXPECT_EQ(render_options("--denoise").denoise, true);
  EXPECT_EQ(render_options("--noisy").denoise, false);
}

TEST(CommandLine, AnUnknownOptionHasTheOneThatIsMeant) {
  const auto meant = [](const std::string& arguments) {
    CLI::App app;
    tools::CommandLine said;
    add_commands(app, said);
    EXPECT_THROW(app.parse(arguments, false), CLI::ParseError);
    return meant_option(app);
  };
  EXPECT_EQ(meant("render session --adaptiv"), "did you mean --adaptive?");
  EXPECT_EQ(meant("render session --neighbour=3"), "did you mean --neighbours?");
  EXPECT_EQ(meant("calibrate tags session --ot out.toml"), "did you mean --out?");
  EXPECT_EQ(meant("--log-levl info track session"), "did you mean --log-level?");
  EXPECT_EQ(meant("render session --nothing-like-it"), "");
  EXPECT_EQ(meant("render session more"), "");
}

// CLI11 of Debian 13 (2.4) takes them for one name, and no command can be read at all.
TEST(CommandLine, GivesNoPositionalTheNameOfAnOption) {
  const auto expect_distinct = [](auto& self, const CLI::App& app) -> void {
    std::set<std::string> names;
    for (const CLI::Option* option : app.get_options()) {
      for (const std::string& name : option->get_lnames())
        EXPECT_TRUE(names.insert(name).second) << app.get_name() << ": " << name;
      if (option->get_positional()) {
        EXPECT_TRUE(names.insert(option->get_name(true)).second) << app.get_name();
      }
    }
    for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
      self(self, *command);
  };
  CLI::App rig, tools;
  CommandLine rig_said;
  tools::CommandLine tools_said;
  add_commands(rig, rig_said);
  add_commands(tools, tools_said);
  expect_distinct(expect_distinct, rig);
  expect_distinct(expect_distinct, tools);
}

// A range lets "nan" pass, and a job of the farm with it could not be read by any machine.
TEST(CommandLine, NoOptionTakesWhatIsNoNumber) {
  CLI::App of_the_rig, of_the_tools;
  CommandLine said_to_the_rig;
  tools::CommandLine said;
  add_commands(of_the_rig, said_to_the_rig);
  add_commands(of_the_tools, said);
  int looked_at = 0;
  const std::function<void(CLI::App&)> look = [&](CLI::App& command) {
    for (CLI::Option* option : command.get_options([](CLI::Option*) { return true; })) {
      if (!option->get_type_name().starts_with("FLOAT")) continue;
      ++looked_at;
      for (const char* none : {"nan", "NaN", "-nan", "inf", "-inf", "infinity", "1e999"}) {
        option->clear();
        option->add_result(none);
        EXPECT_THROW(option->run_callback(), CLI::ParseError)
            << command.get_name() << " " << option->get_name() << " " << none;
      }
    }
    for (CLI::App* below : command.get_subcommands([](CLI::App*) { return true; })) look(*below);
  };
  look(of_the_rig);
  look(of_the_tools);
  EXPECT_GT(looked_at, 15);
}

TEST(CommandLine, APictureHasUpToFourNeighboursOnEitherSide) {
  EXPECT_EQ(render_options("--neighbours 0").neighbours, 0);
  EXPECT_EQ(render_options("--neighbours 4").neighbours, 4);
  EXPECT_THROW(render_options("--neighbours 5"), CLI::ParseError);
  EXPECT_THROW(render_options("--neighbours -1"), CLI::ParseError);
}

TEST(CommandLine, RendersGoodTakesOrAllButNotBoth) {
  EXPECT_FALSE(parsed("render takes").render_takes);
  EXPECT_EQ(parsed("render takes --good").render_takes, post::WhichTakes::good);
  EXPECT_EQ(parsed("render takes --all").render_takes, post::WhichTakes::all);
  EXPECT_THROW(parsed("render takes --all --good"), CLI::ParseError);
  EXPECT_THROW(parsed("render take --scale 0"), CLI::ParseError);
}

// What changes or deletes takes is given them by name: nothing stands for "all".
TEST(CommandLine, TakesAreNamed) {
  for (const char* verb : {"list", "mark", "check", "delete", "copy --to disk"})
    EXPECT_THROW(parsed(std::string("takes ") + verb), CLI::ParseError) << verb;
  EXPECT_THROW(parsed("takes copy one"), CLI::ParseError);
  EXPECT_THROW(parsed("takes"), CLI::ParseError);
  const tools::CommandLine copied = parsed("takes copy one two --to disk");
  EXPECT_EQ(copied.takes.copied.takes, (post::Paths{"one", "two"}));
  EXPECT_EQ(copied.takes.copied.folder, "disk");
  EXPECT_FALSE(parsed("takes delete one").takes.also_good);
  EXPECT_EQ(parsed("takes check one --repair disk").takes.repaired, "disk");
  EXPECT_TRUE(parsed("takes check one").takes.repaired.empty());
}

std::vector<std::string> names_of(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  return names;
}

// previzd had all commands until the tools became a program of their own.
TEST(FormerCommand, IsEachOfPreviz) {
  CLI::App app;
  tools::CommandLine said;
  add_commands(app, said);
  for (const std::string& name : names_of(app)) {
    if (name == "check") continue;  // both have it
    const char* const words[] = {"previzd", "--log-level", "error", name.c_str(), "take"};
    EXPECT_STREQ(former_command(5, words), name.c_str());
  }
}

TEST(FormerCommand, IsNoneOfPrevizd) {
  CLI::App app;
  CommandLine said;
  add_commands(app, said);
  for (const std::string& name : names_of(app)) {
    const char* const words[] = {"previzd", name.c_str(), "render"};
    EXPECT_EQ(former_command(3, words), nullptr) << name;
  }
}

TEST(FormerCommand, RunsPrevizAndSaysSo) {
  const test::Ended ended = test::run_program({"daemon/previzd", "takes", "list", "/nowhere"});
  EXPECT_EQ(ended.status, 1);
  EXPECT_THAT(ended.said, AllOf(StartsWith("previzd: `previzd takes` is now `previz takes`"),
                                HasSubstr("\npreviz: ")));
}

// The libraries that a program loads, by name, with those that they load.
std::vector<std::string> libraries_of(const std::string& program) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(
      popen(("ldd " PREVIZ_BINARY_DIR "/" + program).c_str(), "r"), pclose);
  std::vector<std::string> names;
  char line[1024];
  while (std::fgets(line, sizeof line, pipe.get())) {
    std::istringstream words(line);
    std::string name;
    words >> name;
    if (name.find(".so") != std::string::npos) names.push_back(name);
  }
  return names;
}

// A rig is restarted in mid-shoot, and carries no parser that it does not use. (Cairo it has by
// Debian's libavcodec, which draws SVG.)
TEST(Programs, TheRigLoadsNoLibraryOfTheTools) {
  const std::vector<std::string> rig = libraries_of("daemon/previzd");
  const std::vector<std::string> tools = libraries_of("daemon/previz");
  const auto has = [](const std::vector<std::string>& names, const std::string& library) {
    return std::ranges::any_of(
        names, [&](const std::string& name) { return name.starts_with("lib" + library); });
  };
  for (const char* library : {"assimp", "exiv2", "yaml-cpp", "tinyxml2", "opencv_imgcodecs",
                              "opencv_photo", "opencv_aruco"}) {
    EXPECT_FALSE(has(rig, library)) << library;
    EXPECT_TRUE(has(tools, library)) << library << ": is its name still right?";
  }
  for (const char* library : {"gdal", "hdf5", "pq.", "poppler", "curl", "sqlite3"})
    EXPECT_FALSE(has(rig, library)) << library;
  EXPECT_GT(rig.size(), 100u);
  EXPECT_LE(rig.size(), 190u);  // Debian 12: 182 without sanitizers
}

}  // namespace previz::command_line_test
