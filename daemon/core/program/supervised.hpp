// Does a command's work in a child process: a library that crashes on what it reads, hangs or eats
// memory costs a line on standard error, and leaves nothing half done.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace previz {

struct Supervision {
  Supervision();

  std::vector<std::filesystem::path> folders;  // those of the work's drafts
  // Is told of work that a signal ended, with what it printed; returns the exit status.
  std::function<int(pid_t worker, const std::string& words)> when_stopped = [](auto...) {
    return 1;
  };
  // What a library may take for one file (reading.hpp): processor time, and memory, bytes.
  std::chrono::milliseconds longest_reading = std::chrono::minutes(10);
  std::uint64_t most_memory;  // half of the computer's
};

// Returns the exit status of `work` in a process of its own, which ends without the program's exit
// handlers, and with this one. SIGINT and SIGTERM are passed on to it. Where a signal ended it, or
// it had to be ended, a line on standard error says so and what it read, and its drafts are
// removed. Call it before there are threads.
int supervised(const std::string& program, const Supervision& supervision,
               const std::function<int()>& work);

}  // namespace previz
