// What previzd and previz do alike with a command line: parse it, log, stop on a signal, work in a
// process of its own where it reads what others made, and say in one line what went wrong.
//
// Exit status: 0 done; 1 an error, one line on standard error says which; 2 the command line cannot
// be understood; 128 + N stopped by signal N (what was finished is on disk, and a render goes on
// there when it is called again).
#pragma once

#include <chrono>
#include <exception>
#include <optional>
#include <string>
#include <utility>

#include "daemon/core/program/signals.hpp"
#include "daemon/core/program/supervised.hpp"

namespace CLI {
class App;
}

namespace previz {

class Program {
 public:
  Program(std::string name, std::string about) : name_(std::move(name)), about_(std::move(about)) {}
  virtual ~Program() = default;
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  // Does the whole of main() and returns the exit status.
  int main(int argc, char** argv);

 protected:
  const std::string& name() const { return name_; }

 private:
  // Adds all commands, and what every command line of ours has (add_general()).
  virtual void add_commands(CLI::App& app) = 0;
  // Runs the command that `app` has parsed; returns the exit status. Throws std::exception.
  virtual int run(const CLI::App& app, const StopOnSignal& stop) = 0;
  // How long a command may go on after a signal. None: as long as it needs, and a stop is its
  // orderly end.
  virtual std::optional<std::chrono::milliseconds> patience(const CLI::App& app) const = 0;
  // Whether a command waits for somebody, and need not say that it still works.
  virtual bool waits(const CLI::App& app) const = 0;
  // How a command is supervised that reads what others made; none: it works in this process.
  virtual std::optional<Supervision> supervision(const CLI::App& app) const = 0;
  // Keeps from that process what the command does not need.
  virtual void confine(const CLI::App&) const {}

  void report(const std::exception& error) const;
  int run_stoppable(const CLI::App& app);
  int run_line(int argc, char** argv);

  const std::string name_, about_;
};

}  // namespace previz
