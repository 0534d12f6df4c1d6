#include "daemon/manual/command.hpp"

#include <CLI/CLI.hpp>

namespace previz::manual {
namespace {

// Returns the text between the first `open` and the next `close`; empty if they are not there.
std::string between(const std::string& text, char open, char close) {
  const std::size_t begin = text.find(open);
  const std::size_t end = text.find(close, begin);
  return end == std::string::npos ? "" : text.substr(begin + 1, end - begin - 1);
}

// CLI11 describes a value's type and checks in one text: "INT:INT in [1 - 100]", "TEXT:{on,off}",
// "ENUM:value in {observer->0,light->1} OR {0,1}".
std::vector<std::string> choices_in(const std::string& type) {
  std::vector<std::string> choices;
  std::istringstream words(between(type, '{', '}'));
  for (std::string word; std::getline(words, word, ',');)
    choices.push_back(word.substr(0, word.find("->")));
  return choices;
}

Option option_of(const CLI::Option& option) {
  Option ours;
  ours.positional = option.get_positional();
  if (ours.positional) ours.names.push_back(option.get_name(true));
  for (const std::string& name : option.get_snames()) ours.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) ours.names.push_back("--" + name);
  ours.required = option.get_required();
  ours.about = option.get_description();
  if (option.get_items_expected_max() == 0) return ours;  // a flag
  const std::string type = option.get_type_name();
  ours.value = type.substr(0, type.find(':'));
  ours.choices = choices_in(type);
  ours.range = between(type, '[', ']');
  ours.standard = option.get_default_str();
  return ours;
}

void add(const CLI::App& app, const std::string& path, std::vector<Command>& commands) {
  Command command{path, app.get_description(), {}, {}};
  for (const bool positional : {true, false})
    for (const CLI::Option* option : app.get_options())
      if (option->get_positional() == positional) command.options.push_back(option_of(*option));
  const auto subcommands = app.get_subcommands([](const CLI::App*) { return true; });
  for (const CLI::App* subcommand : subcommands)
    command.subcommands.push_back(subcommand->get_name());
  commands.push_back(std::move(command));
  for (const CLI::App* subcommand : subcommands)
    add(*subcommand, path + " " + subcommand->get_name(), commands);
}

}  // namespace

std::vector<Command> commands_of(const CLI::App& program) {
  std::vector<Command> commands;
  add(program, program.get_name(), commands);
  return commands;
}

}  // namespace previz::manual
