// Parses the command line of `previz calibrate` and its subcommands.
#pragma once

#include <ostream>

#include "daemon/tools/calibrate/calibrate.hpp"

namespace CLI {
class App;
}

namespace previz::calibrate {

struct Commands {
  LensOptions observer;
  LightOptions light;
  ResponseOptions response;
  DarkOptions dark;
  VignettingOptions vignetting;
  ThinLensOptions lens;
  FromOptions from;
  BalanceOptions balance;
  TagsOptions tags;
};

// Adds `calibrate` with its subcommands to `app`; `commands` must outlive it.
void add_calibrate(CLI::App& app, Commands& commands);
// Runs the subcommand that the command line asked for; returns the program's exit status.
int do_calibrate(const CLI::App& app, const Commands& commands, std::ostream& out);

}  // namespace previz::calibrate
