// Completion of a program's command line by the shell.
#pragma once

#include <string>
#include <vector>

#include "daemon/manual/command.hpp"

namespace previz::manual {

// For bash: commands, options, the words an option or an argument must be one of, the rig's actions
// (asked of `previzctl actions`), and file names elsewhere.
std::string bash_completion(const std::vector<Command>& commands);

}  // namespace previz::manual
