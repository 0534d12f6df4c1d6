// Does a command's work in a child process: a library that crashes on what it reads costs a line
// on standard error, and leaves nothing half done.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace previz::box {

// Returns the exit status of `work` in a process of its own; it ends with this one. SIGINT and
// SIGTERM are passed on to it. Where a signal ended it, a line on standard error says so and what
// it read last (now_reading.hpp), and the status is 1; its drafts in these folders are removed.
// Call it before there are threads.
int supervised(const std::string& program, const std::vector<std::filesystem::path>& folders,
               const std::function<int()>& work);

}  // namespace previz::box
