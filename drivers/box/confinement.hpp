// Takes away from this process, and from those that it makes, what it does not need, by Landlock
// and a filter of system calls. Neither can be undone.
#pragma once

#include <filesystem>
#include <vector>

namespace previz::box {

// What stays in reach, each with all that is below it; what is not there is passed over.
struct Reach {
  std::vector<std::filesystem::path> read;    // files and folders
  std::vector<std::filesystem::path> write;   // changed, made and removed; not read by itself
  std::vector<std::filesystem::path> change;  // files whose content may be changed; likewise
};

// Leaves only these files in reach. Throws previz::Error that says what the kernel lacks.
void confine_files(const Reach& reach);

// Refuses from now on, to the thread that calls and those that it starts, sockets of the network,
// the running of other programs, a look into other processes, and to make files shorter that are
// not open for writing, which Landlock does not see before Linux 6.2. Throws previz::Error.
void leave_network_and_programs();

}  // namespace previz::box
