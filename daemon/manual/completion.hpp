// Writes the script by which a shell completes a program's command line.
#pragma once

#include <string>
#include <vector>

#include "daemon/manual/command.hpp"

namespace previz::manual {

// Returns a script for bash that completes commands, options, the words that an option or an
// argument must be one of, the rig's actions (it asks `previzctl actions`), and file names
// elsewhere.
std::string bash_completion(const std::vector<Command>& commands);

}  // namespace previz::manual
