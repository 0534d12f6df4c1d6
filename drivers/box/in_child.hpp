// Does work in a child process, so that a library that crashes or hangs takes nothing else along.
#pragma once

#include <functional>
#include <string>

namespace previz::box {

// Returns what `work` returns in a process of its own, which has at most ten minutes of CPU time,
// three quarters of the computer's memory, and no file, network or program in reach. A
// previz::Error that it throws is thrown here. Throws previz::Error, "SUBJECT: ...", if the process
// ends otherwise. What the work changes is lost.
std::string in_child(const std::string& subject, const std::function<std::string()>& work);

}  // namespace previz::box
