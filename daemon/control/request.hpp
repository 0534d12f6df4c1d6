// Defines the command line of previzctl, by which the rig is asked for something. The program
// parses with it, and the manual page and the shell completion are printed from it.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace previz::control {

struct Request {
  std::string mode;    // "standby", "live", "refine", "review"
  std::string record;  // "on", "off"
  std::string action;  // a name in daemon/core/set/actions.hpp
  std::string set;     // "reload", "next", "previous"
  bool names_only = false;
  bool raw = false;  // status by the names and values of the bus
};

// Adds all subcommands and options to `app`, which writes what it parses into `asked`; `asked` must
// outlive `app`.
void add_requests(CLI::App& app, Request& asked);

}  // namespace previz::control
