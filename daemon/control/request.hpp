// The command line of previzctl: what is asked of the rig. The program parses by it, and the manual
// page and the shell completion are printed from it.
#pragma once

#include <string>

namespace CLI {
class App;
}

namespace previz::control {

struct Request {
  std::string mode;    // "standby", "live", "refine", "review"
  std::string record;  // "on", "off"
  std::string action;  // of daemon/set/actions.hpp
  std::string set;     // "reload", "next", "previous"
  bool names_only = false;
};

// Adds everything to `app`; `asked` must outlive it.
void add_requests(CLI::App& app, Request& asked);

}  // namespace previz::control
