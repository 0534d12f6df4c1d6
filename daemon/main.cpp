// previzd parses the command line and runs a rig, or what a rig needs; it does nothing else.
//
// Exit status: as core/program/program.hpp has it; and 75: the service wants to be started again,
// because another version was installed, or the driver of the graphics card was loaded.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <iostream>

#include "daemon/bench/figures.hpp"
#include "daemon/command_line.hpp"
#include "daemon/core/program/program.hpp"
#include "daemon/core/report/log.hpp"
#include "daemon/core/report/reports.hpp"
#include "daemon/device_rules.hpp"
#include "daemon/devices.hpp"
#include "daemon/former_commands.hpp"
#include "daemon/rig/service.hpp"

namespace {

using namespace previz;

int do_devices(bool learn, bool rules, const StopOnSignal& stop) {
  if (rules) return print_device_rules(std::cout), 0;
  learn ? learn_buttons(std::cout, stop.token()) : list_devices(std::cout);
  return 0;
}

int do_bench(bench::BenchOptions& options, const StopOnSignal& stop) {
  options.stop = stop.token();
  const bench::BenchReport report = bench::run_bench(options, std::cout);
  for (const auto& file : {options.json, options.page})
    if (file) std::cout << file->string() << "\n";
  std::cout << std::flush;
  return 0;
}

int do_run(rig::LiveOptions& options, const StopOnSignal& stop) {
  options.stop = stop.token();
  report::Reports reports(report::log);
  if (options.bus) {
    options.replaced = [] { return rig::Service::program_was_replaced(); };
    options.has_new_devices = [kinds = rig::Service::device_kinds()] {
      return rig::Service::device_kinds() != kinds;
    };
  }
  const std::string metrics = to_json(rig::run_live(options, reports));
  if (!options.bus) std::cout << metrics;  // a service publishes them on the bus
  if (options.bus && stop.received() == 0 && (options.replaced() || options.has_new_devices()))
    return rig::Service::start_again;
  return 0;  // a rig runs until it is stopped
}

class Previzd : public Program {
 public:
  Previzd() : Program("previzd", "Path-traced previsualization for a camera rig") {}

 private:
  void add_commands(CLI::App& app) override { previz::add_commands(app, said_); }
  int run(const CLI::App& app, const StopOnSignal& stop) override {
    if (app.got_subcommand("bench")) return do_bench(said_.bench, stop);
    if (app.got_subcommand("check")) return check::check_set(said_.check, std::cout);
    if (app.got_subcommand("devices")) return do_devices(said_.learn, said_.rules, stop);
    return do_run(said_.run, stop);
  }
  // A rig takes as long as its take needs to be closed; the others end within two seconds.
  std::optional<std::chrono::milliseconds> patience(const CLI::App& app) const override {
    if (app.got_subcommand("run")) return std::nullopt;
    return std::chrono::milliseconds(1500);
  }
  bool waits(const CLI::App& app) const override {
    return app.got_subcommand("run") || said_.learn;
  }
  // A set that is checked may name files of anybody, anywhere.
  std::optional<Supervision> supervision(const CLI::App& app) const override {
    if (!app.got_subcommand("check")) return std::nullopt;
    return Supervision();
  }

  CommandLine said_;
};

}  // namespace

int main(int argc, char** argv) {
  if (const char* command = former_command(argc, argv)) return run_former_command(command, argv);
  return Previzd().main(argc, argv);
}
