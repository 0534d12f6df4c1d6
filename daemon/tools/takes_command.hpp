// Parses the command line of `previz takes` and its subcommands.
#pragma once

#include <filesystem>
#include <ostream>
#include <stop_token>

#include "daemon/tools/post/takes.hpp"

namespace CLI {
class App;
}

namespace previz::tools {

struct TakesCommands {
  post::Paths listed, marked, checked, deleted;
  bool not_good = false;           // take the mark away
  bool also_good = false;          // delete takes that are marked good, too
  std::filesystem::path repaired;  // folder for repaired takes; empty: takes are only checked
  post::CopyOptions copied;
};

// Adds `takes` with its subcommands to `app`; `commands` must outlive it.
void add_takes(CLI::App& app, TakesCommands& commands);
// Runs the subcommand that the command line asked for; returns the program's exit status.
int do_takes(const CLI::App& app, const TakesCommands& commands, std::ostream& out,
             const std::stop_token& stop);

}  // namespace previz::tools
