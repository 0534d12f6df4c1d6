// Parses the command line of `previz print` and its subcommands.
#pragma once

#include <ostream>

#include "daemon/tools/print/print.hpp"

namespace CLI {
class App;
}

namespace previz::print {

struct Commands {
  TagOptions tags, block, stick;
  BoardOptions board;
};

// Adds `print` with its subcommands to `app`; `commands` must outlive it.
void add_print(CLI::App& app, Commands& commands);
// Runs the subcommand that the command line asked for; returns the program's exit status.
int do_print(const CLI::App& app, const Commands& commands, std::ostream& out);

}  // namespace previz::print
