// What the main() of every program that measures does.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>

namespace previz::bench {

// Reads the options and calls `run`. Returns the exit status: 1 where it throws, and says why on
// standard error.
template <class Run>
int run_program(CLI::App& app, int argc, char** argv, const Run& run) {
  CLI11_PARSE(app, argc, argv);
  try {
    run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", argv[0], error.what());
    return 1;
  }
  return 0;
}

}  // namespace previz::bench
