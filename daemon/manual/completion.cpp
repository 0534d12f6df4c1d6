#include "daemon/manual/completion.hpp"

#include <sstream>

namespace previz::manual {
namespace {

// Returns the words that may stand for a value; empty: anything may.
std::string offers(const Option& option) {
  if (option.value == "ACTION") return "$(previzctl actions --names)";
  std::string words;
  for (const std::string& choice : option.choices) words += (words.empty() ? "" : " ") + choice;
  return words;
}

std::string offers(const Command& command) {
  std::string words;
  const auto add = [&](const std::string& more) {
    if (!more.empty()) words += (words.empty() ? "" : " ") + more;
  };
  for (const std::string& subcommand : command.subcommands) add(subcommand);
  for (const Option& option : command.options)
    if (option.positional) add(offers(option));
  for (const Option& option : command.options)
    if (!option.positional) add(option.names.back());
  return words;
}

}  // namespace

std::string bash_completion(const std::vector<Command>& commands) {
  const std::string& program = commands.front().path;
  std::ostringstream out;
  out << "# bash completion for " << program << "; printed from its command line by print_manual.\n"
      << "_" << program << "() {\n"
      << "  local command=" << program << " offers= word i\n"
      << "  for ((i = 1; i < COMP_CWORD; i++)); do\n"
      << "    case \"$command ${COMP_WORDS[i]}\" in\n";
  for (const Command& command : commands)
    if (command.path != program)
      out << "      \"" << command.path << "\") command+=\" ${COMP_WORDS[i]}\" ;;\n";
  out << "    esac\n  done\n"
      << "  case \"$command ${COMP_WORDS[COMP_CWORD - 1]}\" in\n";
  for (const Command& command : commands)
    for (const Option& option : command.options)
      if (!option.positional && !option.value.empty())
        for (const std::string& name : option.names)
          out << "    \"" << command.path << ' ' << name << "\") offers=\"" << offers(option)
              << "\" ;;\n";
  out << "    *)\n      case $command in\n";
  for (const Command& command : commands)
    out << "        \"" << command.path << "\") offers=\"" << offers(command) << "\" ;;\n";
  out << "      esac ;;\n  esac\n"
      << "  word=${COMP_WORDS[COMP_CWORD]}\n"
      << "  mapfile -t COMPREPLY < <(compgen -W \"$offers\" -- \"$word\")\n"
      << "}\n"
      << "complete -o default -F _" << program << ' ' << program << '\n';
  return out.str();
}

}  // namespace previz::manual
