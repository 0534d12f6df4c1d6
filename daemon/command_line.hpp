// Defines the command line of previzd: its subcommands and their options. The program parses with
// it, and the manual page and the shell completion are printed from it.
#pragma once

#include <string>

#include "daemon/bench/bench.hpp"
#include "daemon/core/check/check.hpp"
#include "daemon/rig/live.hpp"

namespace CLI {
class App;
}

namespace previz {

struct CommandLine {
  std::string log_level = "info";
  rig::LiveOptions run;
  check::CheckOptions check;
  bool learn = false, rules = false;  // of devices
  bench::BenchOptions bench;
};

// Adds all subcommands and options to `app`, which writes what it parses into `said`; `said` must
// outlive `app`.
void add_commands(CLI::App& app, CommandLine& said);

}  // namespace previz
