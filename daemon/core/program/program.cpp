#include "daemon/core/program/program.hpp"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <iostream>
#include <sstream>
#include <vector>

#include "daemon/core/program/options.hpp"
#include "daemon/core/report/log.hpp"
#include "daemon/core/report/printable.hpp"
#include "daemon/core/report/standard_output.hpp"
#include "daemon/core/report/still_working.hpp"

namespace previz {

// Logs to the journal with the priority of an error; on a terminal the line looks like any
// command's.
void Program::report(const std::exception& error) const {
  if (report::destination() == report::Destination::journal)
    report::log({report::Severity::error, "", error.what()});
  else
    std::cerr << name_ << ": " << with_short_lines(error.what()) << std::endl;
}

int Program::run_stoppable(const CLI::App& app) {
  const auto patience = this->patience(app);
  const StopOnSignal stop(patience);
  int status = 1;
  std::vector<std::ostream*> terminals;
  if (isatty(STDOUT_FILENO) != 0) terminals.push_back(&std::cout);
  if (isatty(STDERR_FILENO) != 0) terminals.push_back(&std::cerr);
  try {
    std::optional<StillWorking> working;
    if (!waits(app) && !terminals.empty())
      working.emplace(name_ + " " + app.get_subcommands().front()->get_name() + ": still working",
                      terminals);
    status = run(app, stop);
  } catch (const std::exception& error) {
    report(error);
  }
  return stop.received() != 0 && patience ? 128 + stop.received() : status;
}

int Program::run_line(int argc, char** argv) {
  CLI::App app{about_, name_};
  try {
    add_commands(app);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    std::ostringstream refusal;
    const int status = app.exit(error, std::cout, refusal);
    std::cerr << with_short_lines(refusal.str());
    if (status == 0) return 0;
    if (const std::string meant = meant_option(app); !meant.empty()) std::cerr << meant << '\n';
    return 2;
  } catch (const std::exception& error) {
    report(error);
    return 1;
  }
  report::start_log(report::severity_named(app.get_option("--log-level")->as<std::string>()));
  const auto supervision = this->supervision(app);
  if (!supervision) return run_stoppable(app);
  return supervised(name_, *supervision, [&] {
    confine(app);
    return finished_output(name_, run_stoppable(app));
  });
}

int Program::main(int argc, char** argv) {
  // Its other lines would come between ours. libcamera's logSetLevel("*", ...) changes nothing in
  // 0.0.3 (Debian 12), which looks for a category of that name.
  ::setenv("LIBCAMERA_LOG_LEVELS", "*:ERROR", /*overwrite=*/0);
  const SafeOutput out(std::cout), errors(std::cerr);
  return finished_output(name_, run_line(argc, argv));
}

}  // namespace previz
