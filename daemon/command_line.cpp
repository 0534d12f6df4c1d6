#include "daemon/command_line.hpp"

#include <CLI/CLI.hpp>

#include "daemon/core/program/options.hpp"

namespace previz {
namespace {

void add_run(CLI::App& app, rig::LiveOptions& options) {
  CLI::App& command =
      *app.add_subcommand("run", "Composite live, until the cameras stop or Ctrl-C is pressed");
  command.add_option("set", options.set_file, "Set file")->required();
  add_with(command, options.with);
  command.add_option("--spp", options.samples, "Samples per pixel (default: quality.samples)")
      ->check(CLI::Range(1, 1'000'000));
  command.add_option("--out", options.directory, "Folder for picture.png and metrics.json");
  command.add_flag("--bus", options.bus, "Serve org.previz.Rig1 on the system bus (previzctl)");
  command.add_flag("--loop", options.loop, "Loop replayed cameras forever");
  add_device_options(command, options.device);
}

void add_bench(CLI::App& app, bench::BenchOptions& options) {
  CLI::App& command =
      *app.add_subcommand("bench", "Measure what this machine's graphics card can do");
  command.add_option("set", options.set_or_session,
                     "Set file or session folder whose frames are measured, too");
  command
      .add_option("--seconds", options.seconds,
                  "Time for all measurements; what would take longer is skipped, but for the first "
                  "picture, with which every page has a figure")
      ->check(CLI::Range(10, 3600))
      ->capture_default_str();
  command.add_option("--json", options.json, "File for all figures, as JSON");
  command.add_option("--page", options.page, "File for a page to read, as HTML");
  add_device_options(command, options.device);
}

void add_devices(CLI::App& app, bool& learn, bool& rules) {
  CLI::App& command = *app.add_subcommand(
      "devices", "List cameras, buttons and screens by the names that a set file uses");
  command.add_flag("--learn", learn,
                   "Print the name of every button that is pressed, until Ctrl-C");
  command.add_flag("--rules", rules,
                   "Print the udev rules that let the service open pads, pedals and GPIO chips");
}

}  // namespace

void add_commands(CLI::App& app, CommandLine& said) {
  add_general(app, said.log_level);
  add_run(app, said.run);
  add_check(app, said.check);
  add_devices(app, said.learn, said.rules);
  add_bench(app, said.bench);
  refuse_what_is_no_number(app);
}

}  // namespace previz
