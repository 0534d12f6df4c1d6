// What the command line leaves to the set file, and what it does not.
#include "daemon/command_line.hpp"

#include <CLI/CLI.hpp>

#include "tests/support/test.hpp"

namespace previz::command_line_test {

CommandLine parsed(const std::string& arguments) {
  CLI::App app;
  CommandLine said;
  add_commands(app, said);
  app.parse(arguments, false);
  return said;
}

post::RenderOptions render_options(const std::string& arguments) {
  return parsed("render session " + arguments).render;
}

rig::LiveOptions live_options(const std::string& arguments) {
  return parsed("run set.toml " + arguments).run;
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
    CommandLine said;
    add_commands(app, said);
    EXPECT_THROW(app.parse(arguments, false), CLI::ParseError);
    return meant_option(app);
  };
  EXPECT_EQ(meant("render session --adaptiv"), "did you mean --adaptive?");
  EXPECT_EQ(meant("render session --neighbour=3"), "did you mean --neighbours?");
  EXPECT_EQ(meant("calibrate tags session --ot out.toml"), "did you mean --out?");
  EXPECT_EQ(meant("--log-levl info run set.toml"), "did you mean --log-level?");
  EXPECT_EQ(meant("render session --nothing-like-it"), "");
  EXPECT_EQ(meant("render session more"), "");
}

// A range lets "nan" pass, and a job of the farm with it could not be read by any machine.
TEST(CommandLine, NoOptionTakesWhatIsNoNumber) {
  CLI::App app;
  CommandLine said;
  add_commands(app, said);
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
  look(app);
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
  const CommandLine copied = parsed("takes copy one two --to disk");
  EXPECT_EQ(copied.takes.copied.takes, (post::Paths{"one", "two"}));
  EXPECT_EQ(copied.takes.copied.folder, "disk");
  EXPECT_FALSE(parsed("takes delete one").takes.also_good);
  EXPECT_EQ(parsed("takes check one --repair disk").takes.repaired, "disk");
  EXPECT_TRUE(parsed("takes check one").takes.repaired.empty());
}

}  // namespace previz::command_line_test
