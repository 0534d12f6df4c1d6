#include "daemon/manual/man_page.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cctype>
#include <sstream>

#include "daemon/core/set/table.hpp"

namespace previz::manual {
namespace {

// Returns text in the form that roff wants: with a minus that can be copied, without escapes, and
// with no line that is a request.
std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (out.empty() || out.back() == '\n')
      if (c == '.' || c == '\'') out += "\\&";
    if (c == '-')
      out += "\\-";
    else if (c == '\\')
      out += "\\e";
    else
      out += c;
  }
  return out;
}

std::string bold(const std::string& text) {
  return fmt::format("\\fB{}\\fR", escaped(text));
}
std::string italic(const std::string& text) {
  return fmt::format("\\fI{}\\fR", escaped(text));
}

template <class Words, class Style>
std::string joined(const Words& words, const std::string& separator, Style style) {
  std::string out;
  for (const auto& word : words) out += (out.empty() ? "" : separator) + style(word);
  return out;
}

// "previz farm" has the page previz-farm.
std::string page_name(std::string path) {
  std::ranges::replace(path, ' ', '-');
  return path;
}

void head(std::ostream& out, const std::string& name, int section, const std::string& about) {
  std::string title = name;
  std::ranges::transform(title, title.begin(), [](unsigned char c) { return std::toupper(c); });
  out << ".TH " << escaped(title) << ' ' << section << " \"\" \"previzd " PREVIZ_VERSION "\"\n"
      << ".SH NAME\n"
      << escaped(name) << " \\- " << escaped(about) << '\n';
}

void entry(std::ostream& out, const std::string& term, const std::string& text) {
  out << ".TP\n" << term << '\n' << escaped(text) << '\n';
}

std::string value_of(const Option& option) {
  return option.choices.empty() ? italic(option.value) : joined(option.choices, "|", bold);
}

// "session"; "on|off"; "-h, --help"; "--spp INT"
std::string term_of(const Option& option) {
  if (option.positional)
    return option.choices.empty() ? italic(option.names.front()) : value_of(option);
  const std::string names = joined(option.names, ", ", bold);
  return option.value.empty() ? names : fmt::format("{} {}", names, value_of(option));
}

void print(std::ostream& out, const Option& option) {
  std::string text = option.about.empty() ? "One of these" : option.about;
  if (!option.range.empty()) text += fmt::format("; {}", option.range);
  if (!option.standard.empty()) text += fmt::format(" (default: {})", option.standard);
  entry(out, term_of(option), text);
}

// "previz render [OPTION...] session"
std::string usage(const Command& command) {
  std::string line = fmt::format("{} [{}...]", bold(command.path), italic("OPTION"));
  for (const Option& option : command.options)
    if (option.positional) line += fmt::format(" {}", term_of(option));
  return line;
}

// Returns how a program or a command with commands of its own is called: with one of them, or, if
// it has an argument, also without.
std::string usage_with_commands(const Command& command) {
  const bool has_argument = std::ranges::any_of(command.options, &Option::positional);
  return (has_argument ? usage(command) + "\n.br\n" : "") +
         fmt::format("{} [{}...] {}", bold(command.path), italic("OPTION"), italic("COMMAND"));
}

void print(std::ostream& out, const Command& command) {
  for (const Option& option : command.options) print(out, option);
}

void print(std::ostream& out, const Chapter& chapter) {
  out << ".SH " << escaped(chapter.title) << '\n';
  std::istringstream lines(chapter.text);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty()) continue;
    const std::size_t colon = line.find(": ");
    const bool is_entry =
        colon != std::string::npos && (chapter.is_list || line.find(' ') >= colon);
    if (!is_entry)
      out << ".PP\n" << escaped(line) << '\n';
    else
      entry(out, bold(line.substr(0, colon)), line.substr(colon + 2));
  }
}

// Returns "key = default", or "key = example" if there is no default.
std::string assignment(const set::Key& key) {
  const bool has_default = key.need.kind == Need::Kind::defaulted;
  return bold(key.name) + " = " + escaped(has_default ? key.initial : key.need.example);
}

std::string explanation(const set::Key& key) {
  using enum Need::Kind;
  const char* need = key.need.kind == required   ? "; required"
                     : key.need.kind == optional ? "; optional, the value here is an example"
                                                 : "";
  return fmt::format("{} ({}{})", key.about, key.allowed, need);
}

}  // namespace

std::string man_page(const std::vector<Command>& commands, int section,
                     const std::vector<Chapter>& chapters) {
  std::ostringstream out;
  const Command& program = commands.front();
  head(out, page_name(program.path), section, program.about);
  out << ".SH SYNOPSIS\n" << usage_with_commands(program) << "\n.SH OPTIONS\n";
  print(out, program);
  out << ".SH COMMANDS\n";
  for (const Command& command : commands)
    if (&command != &program && command.subcommands.empty()) {
      out << ".SS " << usage(command) << '\n' << escaped(command.about) << ".\n";
      print(out, command);
    }
  for (const Chapter& chapter : chapters) print(out, chapter);
  return out.str();
}

std::string set_man_page(const Chapter& description, const Chapter& see_also) {
  std::ostringstream out;
  head(out, "previz-set", 5, "The set file of previzd");
  print(out, description);
  out << ".SH TABLES AND KEYS\n";
  set::Draft draft;
  for (const set::Section& section : set::sections(draft)) {
    const bool repeated = section.kind == set::Section::Kind::repeated;
    const std::string header =
        repeated ? fmt::format("[[{}]]", section.path) : fmt::format("[{}]", section.path);
    out << ".SS " << escaped(header) << '\n' << escaped(section.about) << '\n';
    for (const set::Key& key : section.open().keys) entry(out, assignment(key), explanation(key));
  }
  print(out, see_also);
  return out.str();
}

}  // namespace previz::manual
