// Runs a program of the scheduler and returns what it printed.
#pragma once

#include <chrono>
#include <string>
#include <vector>

namespace previz::farm {

struct ProgramResult {
  bool is_there = true;  // false: there is no such program
  bool is_late = false;  // it did not end in time, and was ended
  int status = 0;        // its exit status; 128 + N where signal N ended it
  std::string out;       // standard output, at most 64 MiB
  std::string errors;    // standard error, likewise

  bool is_good() const { return is_there && status == 0; }
  // Returns why it failed, on one line: its own last words, or its exit status.
  std::string why() const;
};

// Runs `program`, which is looked for in PATH, without a shell: no argument is taken for anything
// else. It has no input, and is ended by timeout(1) where it takes longer than `patience`. Throws
// previz::Error where the computer cannot start a process.
ProgramResult run_program(const std::string& program, const std::vector<std::string>& arguments,
                          std::chrono::milliseconds patience = std::chrono::minutes(1));

}  // namespace previz::farm
