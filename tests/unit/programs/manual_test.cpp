// The manual pages and the completions say what the programs do.
#include <CLI/CLI.hpp>

#include "daemon/command_line.hpp"
#include "daemon/core/set/actions.hpp"
#include "daemon/core/set/table.hpp"
#include "daemon/manual/command.hpp"
#include "daemon/manual/pages.hpp"
#include "daemon/tools/calibrate/lens/board.hpp"
#include "daemon/tools/command_line.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/test.hpp"

namespace previz::manual::manual_test {

using test::TemporaryDirectory;
using testing::IsSupersetOf;

TEST(ManualCommands, AreReadOffTheParser) {
  CLI::App app{"Does things", "tool"};
  std::string kind, from;
  int count = 3;
  bool quiet = false;
  CLI::App& copy = *app.add_subcommand("copy", "Copies");
  copy.add_option("from", from, "What")->required();
  copy.add_option("-k,--kind", kind, "How")->check(CLI::IsMember({"fast", "safe"}));
  copy.add_option("--count", count, "How often")->check(CLI::Range(1, 9))->capture_default_str();
  copy.add_flag("--quiet", quiet, "No word");

  const std::vector<Command> commands = commands_of(app);
  ASSERT_EQ(commands.size(), 2u);
  EXPECT_THAT(commands[0].subcommands, ElementsAre("copy"));
  EXPECT_EQ(commands[1].path, "tool copy");
  ASSERT_EQ(commands[1].options.size(), 5u);  // with --help, which CLI11 adds
  const Option &what = commands[1].options[0], &how = commands[1].options[2],
               &often = commands[1].options[3], &no_word = commands[1].options[4];
  EXPECT_TRUE(what.positional && what.required);
  EXPECT_THAT(what.names, ElementsAre("from"));
  EXPECT_THAT(how.names, ElementsAre("-k", "--kind"));
  EXPECT_THAT(how.choices, ElementsAre("fast", "safe"));
  EXPECT_EQ(often.range, "1 - 9");
  EXPECT_EQ(often.standard, "3");
  EXPECT_EQ(no_word.value, "");
  EXPECT_EQ(no_word.about, "No word");
}

std::string page(const std::vector<Page>& pages, const std::string& name) {
  for (const Page& each : pages)
    if (each.name == name) return each.text;
  ADD_FAILURE() << "no page " << name;
  return "";
}

TEST(ManualPages, HaveEveryKeyOfASetFile) {
  const std::string text = page(man_pages(), "previz-set.5");
  set::Draft draft;
  for (const set::Section& section : set::sections(draft)) {
    EXPECT_THAT(text, HasSubstr("[" + section.path + "]"));
    for (const set::Key& key : section.open().keys)
      EXPECT_THAT(text, HasSubstr("\\fB" + key.name + "\\fR = ")) << section.path;
  }
}

TEST(ManualPages, HaveEveryActionOfTheRig) {
  const std::string text = page(man_pages(), "previzctl.1");
  for (const char* action : set::action_names())
    EXPECT_THAT(text, HasSubstr("\n\\fB" + std::string(action) + "\\fR\n"));
}

TEST(ManualPages, ShowHowEachCommandIsCalled) {
  const std::string text = page(man_pages(), "previz.1");
  EXPECT_THAT(text, HasSubstr(".SS \\fBpreviz render\\fR [\\fIOPTION\\fR...] \\fIsession\\fR\n"));
  EXPECT_THAT(text, HasSubstr(".SS \\fBpreviz calibrate lens\\fR"));
  EXPECT_THAT(text, HasSubstr("\\fB\\-\\-estimator\\fR \\fBpaired\\fR|\\fBdifference\\fR\n"));
}

std::vector<Command> previz_commands() {
  CLI::App app{"", "previz"};
  tools::CommandLine said;
  add_commands(app, said);
  return commands_of(app);
}

TEST(ManualPages, OfTheFarmHasEachOfItsCommandsAndOptions) {
  const std::string text = page(man_pages(), "previz-farm.1");
  EXPECT_THAT(text, HasSubstr(".SH NAME\npreviz\\-farm \\- Render takes on many machines"));
  int commands = 0;
  for (const Command& command : previz_commands()) {
    if (command.path != "previz farm" && !command.path.starts_with("previz farm ")) continue;
    SCOPED_TRACE(command.path);
    ++commands;
    const std::size_t begin = text.find("\\fB" + command.path + "\\fR [");
    ASSERT_NE(begin, std::string::npos);
    const std::string after = text.substr(begin);
    for (const Option& option : command.options)
      for (std::string name : option.names) {
        for (std::size_t at = 0; (at = name.find('-', at)) != std::string::npos; at += 2)
          name.insert(at, "\\");
        EXPECT_THAT(after, HasSubstr("\\f" + std::string(option.positional ? "I" : "B") + name));
      }
  }
  EXPECT_EQ(commands, 6);
}

TEST(ManualPages, LeaveTheFarmsOptionsToItsOwnPage) {
  const std::string text = page(man_pages(), "previz.1");
  EXPECT_THAT(text, HasSubstr(".SS \\fBpreviz farm\\fR"));
  EXPECT_THAT(text, HasSubstr("See previz\\-farm(1)."));
  EXPECT_THAT(text, Not(HasSubstr("openjd")));
}

// Returns the terms of the list in a section of a page, without roff's escapes.
std::vector<std::string> terms_of(const std::string& text, const std::string& section) {
  std::istringstream lines(text);
  std::vector<std::string> terms;
  bool inside = false;
  std::string before;
  for (std::string line; std::getline(lines, line); before = line) {
    if (line.starts_with(".SH ")) inside = line == ".SH " + section;
    if (!inside || before != ".TP") continue;
    for (const std::string mark : {"\\fB", "\\fR"})
      if (const std::size_t at = line.find(mark); at != std::string::npos) line.erase(at, 3);
    std::erase(line, '\\');
    terms.push_back(line);
  }
  return terms;
}

TEST(ManualPages, HaveExamplesThatTheCommandLineUnderstands) {
  std::vector<std::string> of_the_rig = terms_of(page(man_pages(), "previzd.8"), "EXAMPLES");
  EXPECT_GE(of_the_rig.size(), 8u);
  for (const std::string& example : of_the_rig) {
    CLI::App app{"", "previzd"};
    CommandLine said;
    add_commands(app, said);
    EXPECT_NO_THROW(app.parse(example, true)) << example;
  }
  std::vector<std::string> examples = terms_of(page(man_pages(), "previz.1"), "EXAMPLES");
  EXPECT_GE(examples.size(), 8u);
  const std::vector<std::string> of_farm = terms_of(page(man_pages(), "previz-farm.1"), "EXAMPLE");
  EXPECT_GE(of_farm.size(), 5u);
  examples.insert(examples.end(), of_farm.begin(), of_farm.end());
  for (const std::string& example : examples) {
    SCOPED_TRACE(example);
    CLI::App app{"", "previz"};
    tools::CommandLine said;
    add_commands(app, said);
    EXPECT_NO_THROW(app.parse(example, true));
    for (const std::string& board : {said.calibrate.observer.board, said.calibrate.light.board})
      if (!board.empty()) {
        EXPECT_NO_THROW(calibrate::parse_board(board));
      }
  }
}

TEST(ManualPages, HaveAGlossaryInOrder) {
  const std::vector<std::string> terms = terms_of(page(man_pages(), "previzd.8"), "GLOSSARY");
  EXPECT_THAT(terms, IsSupersetOf({"bracket", "carrier", "lamp", "phantom", "plate", "refine",
                                   "review", "take", "virtual object"}));
  EXPECT_TRUE(std::ranges::is_sorted(terms));
}

// What a shell command says, a line each.
std::vector<std::string> lines_of(const std::string& command) {
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  std::vector<std::string> lines;
  char line[256];
  while (std::fgets(line, sizeof line, pipe.get()))
    if (std::string text = line; text != "\n") lines.push_back(text.substr(0, text.size() - 1));
  return lines;
}

// A page that groff, which man(1) sets pages by, has nothing to say about.
TEST(ManualPages, AreSetWithoutAWarning) {
  if (lines_of("command -v groff").empty()) GTEST_SKIP() << "groff is not installed";
  const TemporaryDirectory directory;
  for (const Page& each : man_pages()) {
    const std::filesystem::path file = directory / each.name;
    std::ofstream(file) << each.text;
    EXPECT_THAT(lines_of("groff -man -Tutf8 -ww -z '" + file.string() + "' 2>&1"), ElementsAre());
  }
}

// What bash offers where `typed` ends; its last word is the one to be completed.
std::vector<std::string> completed(const std::string& program,
                                   const std::vector<std::string>& typed) {
  const TemporaryDirectory directory;
  const std::filesystem::path script = directory.path() / "complete.bash";
  std::ofstream out(script);
  out << page(bash_completions(), program) << "\nPATH=" PREVIZ_BINARY_DIR
      << "/daemon/control:$PATH\nCOMP_WORDS=(" << program;
  for (const std::string& word : typed) out << " '" << word << "'";
  out << ")\nCOMP_CWORD=" << typed.size() << "\n_" << program
      << "\nprintf '%s\\n' \"${COMPREPLY[@]}\"\n";
  out.close();
  return lines_of("bash " + script.string());
}

TEST(BashCompletion, OffersCommandsOptionsAndChoices) {
  EXPECT_THAT(completed("previz", {""}),
              IsSupersetOf({"render", "calibrate", "--log-level", "--help"}));
  EXPECT_THAT(completed("previz", {"re"}), ElementsAre("render"));
  EXPECT_THAT(completed("previz", {"calibrate", "re"}), ElementsAre("response"));
  EXPECT_THAT(completed("previz", {"calibrate", "response", "--m"}), ElementsAre("--method"));
  EXPECT_THAT(completed("previz", {"render", "take", "--estimator", ""}),
              ElementsAre("paired", "difference"));
  EXPECT_THAT(completed("previzd", {"--log-level", "debug", "ch"}), ElementsAre("check"));
  // Files: nothing is offered, and bash then completes names of files itself.
  EXPECT_THAT(completed("previz", {"render", "take", "--set", ""}), ElementsAre());
  EXPECT_THAT(completed("previzctl", {"mode", "st"}), ElementsAre("standby"));
}

TEST(BashCompletion, AsksPrevizctlForTheActions) {
  const std::vector<std::string> offers = completed("previzctl", {"action", ""});
  for (const char* action : set::action_names()) EXPECT_THAT(offers, Contains(action));
}

}  // namespace previz::manual::manual_test
