// The commands that previzd had until they became those of previz. For one release, previzd runs
// previz for them, so that scripts and jobs of before go on.
#pragma once

namespace previz {

// Returns the command of previz that previzd's command line asks for; null: none.
const char* former_command(int argc, const char* const* argv);

// Becomes the program previz, which lies beside this one, and says so on standard error. Returns an
// exit status where that is not installed, and says how to.
int run_former_command(const char* command, char** argv);

}  // namespace previz
