// previzd parses the command line and runs the subcommand; it does nothing else.
//
// Exit status: 0 done; 1 an error, one line on standard error says which; 2 the command line cannot
// be understood; 75 the service wants to be started again, because another version was installed,
// or the driver of the graphics card was loaded; 128 + N stopped by signal N (what was finished is
// on disk, and a render goes on there when it is called again).
#include <pwd.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <iostream>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include "daemon/bench/figures.hpp"
#include "daemon/command_line.hpp"
#include "daemon/device_rules.hpp"
#include "daemon/devices.hpp"
#include "daemon/output/take_folders.hpp"
#include "daemon/post/check.hpp"
#include "daemon/post/render_takes.hpp"
#include "daemon/report/log.hpp"
#include "daemon/report/reports.hpp"
#include "daemon/rig/service.hpp"
#include "daemon/set/check.hpp"
#include "daemon/signals.hpp"
#include "daemon/trade/page.hpp"
#include "daemon/written_by.hpp"
#include "drivers/box/confinement.hpp"
#include "drivers/box/supervised.hpp"
#include "drivers/error.hpp"
#include "drivers/printable.hpp"
#include "drivers/standard_output.hpp"
#include "drivers/still_working.hpp"

namespace {

using namespace previz;

// Logs to the journal with the priority of an error; on a terminal the line looks like any
// command's.
void report_end(const std::exception& error) {
  if (report::destination() == report::Destination::journal)
    report::log({report::Severity::error, "", error.what()});
  else
    std::cerr << "previzd: " << with_short_lines(error.what()) << std::endl;
}

int do_devices(bool learn, bool rules, const StopOnSignal& stop) {
  if (rules) return print_device_rules(std::cout), 0;
  learn ? learn_buttons(std::cout, stop.token()) : list_devices(std::cout);
  return 0;
}

int do_export(exchange::ExportOptions& options, const StopOnSignal& stop) {
  options.stop = stop.token();
  exchange::export_take(options, std::cout);
  return 0;
}

int do_track(exchange::TrackOptions& options, const StopOnSignal& stop) {
  options.stop = stop.token();
  return exchange::track_take(options, std::cout);
}

int do_farm(const CLI::App& app, farm::Commands& commands, const StopOnSignal& stop) {
  return farm::do_farm(app, commands, isatty(STDOUT_FILENO) != 0, std::cout, stop.token());
}

int do_import(const exchange::ImportOptions& options) {
  const exchange::ImportReport report = exchange::import_session(options);
  for (const std::string& note : report.notes) report::log({report::Severity::info, "", note});
  std::cout << options.session.string() << ": " << report.observer_frames << " film camera frames, "
            << report.light_frames << " light frames, " << report.poses << " poses, "
            << report.assets << " assets, " << report.bytes / 1'000'000.0 << " MB" << std::endl;
  return 0;
}

int do_render_takes(const post::RenderOptions& options, post::WhichTakes which) {
  const post::TakesReport report = post::render_takes(options, which, std::cout);
  std::cout << set::plural(report.rendered.size(), "take") << " rendered";
  if (!report.failures.empty()) std::cout << ", " << report.failures.size() << " failed";
  std::cout << (report.interrupted ? "; stopped; run the same command to continue" : "")
            << std::endl;
  return report.failures.empty() ? 0 : 1;
}

int do_render_take(const post::RenderOptions& options) {
  const post::RenderReport report = post::render_session(options, std::cout);
  std::cout << report.directory.string() << ": " << set::plural(report.frames.size(), "frame")
            << (report.interrupted ? "; stopped; run the same command to continue" : "")
            << std::endl;
  if (report.failures.empty()) return 0;
  throw Error(std::to_string(report.failures.size()) +
              (report.failures.size() == 1 ? " frame was" : " frames were") + " not made, " +
              report.failures.front());
}

int do_render(post::RenderOptions& options, std::optional<post::WhichTakes> which,
              const StopOnSignal& stop) {
  options.stop = stop.token();
  options.terminal = isatty(STDOUT_FILENO) != 0;
  if (which) return do_render_takes(options, *which);
  return do_render_take(options);
}

int do_model(model::ModelOptions& options) {
  options.terminal = isatty(STDOUT_FILENO) != 0;
  model::make_model(options, std::cout);
  return 0;
}

int do_trade(trade::TradeOptions& options, const StopOnSignal& stop) {
  options.stop = stop.token();
  options.terminal = isatty(STDOUT_FILENO) != 0;
  const trade::TradeReport report = trade::run_trade(options, std::cout);
  std::cout << "\n";
  for (const trade::TradeFrontPoint& at : trade::listed_front_of(report))
    std::cout << trade::front_words(report, at) << "\n";
  std::cout << "\n";
  for (const trade::TradeAnswer& answer : report.answers)
    std::cout << answer.use << ": " << answer.words
              << (answer.is_met ? " (--with " + answer.file.string() + ")" : "") << "\n";
  if (!report.page.empty())
    std::cout << "\n" << report.csv.string() << "\n" << report.page.string() << std::endl;
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

int do_command(const CLI::App& app, CommandLine& said, const StopOnSignal& stop) {
  if (app.got_subcommand("bench")) return do_bench(said.bench, stop);
  if (app.got_subcommand("check")) return post::check_set(said.check, std::cout);
  if (app.got_subcommand("calibrate"))
    return calibrate::do_calibrate(app, said.calibrate, std::cout);
  if (app.got_subcommand("merge")) return do_render(said.merge, std::nullopt, stop);
  if (app.got_subcommand("model")) return do_model(said.model);
  if (app.got_subcommand("devices")) return do_devices(said.learn, said.rules, stop);
  if (app.got_subcommand("export")) return do_export(said.export_take, stop);
  if (app.got_subcommand("farm")) return do_farm(app, said.farm, stop);
  if (app.got_subcommand("import")) return do_import(said.import_session);
  if (app.got_subcommand("print")) return print::do_print(app, said.print, std::cout);
  if (app.got_subcommand("render")) return do_render(said.render, said.render_takes, stop);
  if (app.got_subcommand("takes")) return do_takes(app, said.takes, std::cout, stop.token());
  if (app.got_subcommand("track")) return do_track(said.track, stop);
  if (app.got_subcommand("trade")) return do_trade(said.trade, stop);
  return do_run(said.run, stop);
}

// Commands end within two seconds of a signal. A rig takes as long as its take needs to be closed,
// and a stop is its orderly end. A farm's machine may write down how its task ended while a disk is
// slow; Slurm kills it after half a minute.
int do_stoppable(const CLI::App& app, CommandLine& said) {
  // A model is made without looking for a stop, and would only use up the patience.
  constexpr std::chrono::milliseconds of_a_model(0), of_a_command(1500), of_a_task(20'000);
  const bool is_rig = app.got_subcommand("run");
  const StopOnSignal stop(is_rig                        ? std::nullopt
                          : app.got_subcommand("farm")  ? std::optional(of_a_task)
                          : app.got_subcommand("model") ? std::optional(of_a_model)
                                                        : std::optional(of_a_command));
  int status = 1;
  std::vector<std::ostream*> terminals;
  if (isatty(STDOUT_FILENO) != 0) terminals.push_back(&std::cout);
  if (isatty(STDERR_FILENO) != 0) terminals.push_back(&std::cerr);
  try {
    // A rig goes on until it is stopped, and `devices --learn` waits for buttons.
    std::optional<StillWorking> working;
    if (!is_rig && !said.learn && !terminals.empty())
      working.emplace("previzd " + app.get_subcommands().front()->get_name() + ": still working",
                      terminals);
    status = do_command(app, said, stop);
  } catch (const std::exception& error) {
    report_end(error);
  }
  return stop.received() != 0 && !is_rig ? 128 + stop.received() : status;
}

// Keeps from the command what it does not need, whatever the libraries do that read for it.
void confine(std::vector<std::filesystem::path> written) {
  std::error_code none;
  // Without its devices NVIDIA's driver starts a program that makes them as root.
  for (const char* device : {"/dev/nvidiactl", "/dev/nvidia0", "/dev/nvidia-modeset"})
    if (std::filesystem::exists("/usr/bin/nvidia-modprobe", none) &&
        !std::filesystem::exists(device, none))
      return report::log({report::Severity::info, "",
                          "the command keeps the network and may write anywhere, because "
                          "nvidia-modprobe has not made " +
                              std::string(device) + " yet"});
  for (const char* folder : {"/dev", "/proc", "/tmp", "/var/tmp"}) written.emplace_back(folder);
  written.push_back(std::filesystem::temp_directory_path(none));
  // Compiled shaders are kept there, ours and those of the drivers.
  if (const auto cache = render::cache_folder(); !cache.empty()) {
    std::filesystem::create_directories(cache, none);
    written.push_back(cache.parent_path());
    written.push_back(cache);
  }
  if (const passwd* const user = ::getpwuid(::getuid()))  // where Mesa's is, whatever HOME says
    written.push_back(std::filesystem::path(user->pw_dir) / ".cache");
  for (const char* name : {"MESA_SHADER_CACHE_DIR", "__GL_SHADER_DISK_CACHE_PATH"})
    if (const char* const folder = std::getenv(name); folder && *folder == '/')
      written.push_back(output::existing_part(folder));
  const auto try_to = [](const char* otherwise, const std::function<void()>& call) {
    try {
      call();
    } catch (const Error& error) {
      report::log({report::Severity::info, "", std::string(otherwise) + error.what()});
    }
  };
  try_to("the command keeps the network: ", box::leave_network_and_programs);
  try_to("the command may write anywhere: ", [&] {
    box::confine_files({{"/"}, std::move(written), {}});
  });
}

int do_line(int argc, char** argv) {
  CLI::App app{"Path-traced previsualization for a camera rig", "previzd"};
  CommandLine said;
  try {
    add_commands(app, said);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    std::ostringstream refusal;
    const int status = app.exit(error, std::cout, refusal);
    std::cerr << with_short_lines(refusal.str());
    if (status == 0) return 0;
    if (const std::string meant = meant_option(app); !meant.empty()) std::cerr << meant << '\n';
    return 2;
  } catch (const std::exception& error) {
    report_end(error);
    return 1;
  }
  report::start_log(report::severity_named(said.log_level));
  const auto written = written_by(app, said);
  if (!written) return do_stoppable(app, said);
  box::Supervision supervision;
  supervision.folders = written->drafts;
  if (app.got_subcommand("farm") && app.get_subcommand("farm")->got_subcommand("task"))
    supervision.when_stopped = [&](pid_t task, const std::string& words) {
      return farm::end_stopped_task(said.farm.task, farm::this_machine(), task, words);
    };
  return box::supervised("previzd", supervision, [&] {
    if (written->reach) confine(*written->reach);
    return finished_output("previzd", do_stoppable(app, said));
  });
}

}  // namespace

int main(int argc, char** argv) {
  // Its other lines would come between ours. libcamera's logSetLevel("*", ...) changes nothing in
  // 0.0.3 (Debian 12), which looks for a category of that name.
  ::setenv("LIBCAMERA_LOG_LEVELS", "*:ERROR", /*overwrite=*/0);
  const SafeOutput out(std::cout), errors(std::cerr);
  return finished_output("previzd", do_line(argc, argv));
}
