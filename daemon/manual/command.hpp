// A program's command line as plain data, read off the parser itself: what its manual page and its
// shell completion are printed from, so that neither can tell another story than the program.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace previz::manual {

struct Option {
  std::vector<std::string> names;  // "-h", "--help"; of a positional its one name
  bool positional = false;
  bool required = false;
  std::string value;                 // "TEXT", "INT", ...; empty: a flag
  std::vector<std::string> choices;  // that the value is one of; empty: any
  std::string range;                 // "1 - 100"; empty: any
  std::string standard;              // the value where none is given; empty: as `about` says
  std::string about;
};

struct Command {
  std::string path;  // "previzd calibrate lens"
  std::string about;
  std::vector<Option> options;  // positionals first
  std::vector<std::string> subcommands;
};

// The program itself first, then its subcommands as it lists them, each followed by its own.
std::vector<Command> commands_of(const CLI::App& program);

}  // namespace previz::manual
