// Reads a program's command line off its parser, as plain data. The manual page and the shell
// completion are printed from it, so that they always agree with the program.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace previz::manual {

struct Option {
  std::vector<std::string> names;  // "-h", "--help"; a positional has one name
  bool positional = false;
  bool required = false;
  std::string value;                 // "TEXT", "INT", ...; empty: a flag
  std::vector<std::string> choices;  // the values allowed; empty: any
  std::string range;                 // "1 - 100"; empty: any
  std::string standard;              // the default value; empty: as `about` says
  std::string about;
};

struct Command {
  std::string path;  // "previz calibrate lens"
  std::string about;
  std::vector<Option> options;  // positionals first
  std::vector<std::string> subcommands;
};

// Returns the program itself first, then its subcommands as it lists them, each followed by its
// own.
std::vector<Command> commands_of(const CLI::App& program);

}  // namespace previz::manual
