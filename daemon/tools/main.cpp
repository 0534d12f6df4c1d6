// previz parses the command line and runs the tool; it does nothing else.
//
// Exit status: as core/program/program.hpp has it.
#include <pwd.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <iostream>

#include "daemon/core/output/memory.hpp"
#include "daemon/core/output/take_folders.hpp"
#include "daemon/core/program/program.hpp"
#include "daemon/core/render/device/gpu.hpp"
#include "daemon/core/report/log.hpp"
#include "daemon/core/set/check.hpp"
#include "daemon/tools/command_line.hpp"
#include "daemon/tools/trade/page.hpp"
#include "daemon/tools/written_by.hpp"
#include "drivers/box/confinement.hpp"
#include "drivers/error.hpp"

namespace {

using namespace previz;
using namespace previz::tools;

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
            << ", in at most " << output::peak_memory_bytes() / 1'000'000 << " MB of memory"
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

// Keeps from the command what it does not need, whatever the libraries do that read for it.
void confine_to(std::vector<std::filesystem::path> written) {
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

class Previz : public Program {
 public:
  Previz() : Program("previz", "Tools for the takes and sets of a camera rig that runs previzd") {}

 private:
  void add_commands(CLI::App& app) override { tools::add_commands(app, said_); }
  int run(const CLI::App& app, const StopOnSignal& stop) override {
    if (app.got_subcommand("calibrate"))
      return calibrate::do_calibrate(app, said_.calibrate, std::cout);
    if (app.got_subcommand("check")) return check::check_set(said_.check, std::cout);
    if (app.got_subcommand("export")) return do_export(said_.export_take, stop);
    if (app.got_subcommand("farm")) return do_farm(app, said_.farm, stop);
    if (app.got_subcommand("import")) return do_import(said_.import_session);
    if (app.got_subcommand("merge")) return do_render(said_.merge, std::nullopt, stop);
    if (app.got_subcommand("model")) return do_model(said_.model);
    if (app.got_subcommand("print")) return print::do_print(app, said_.print, std::cout);
    if (app.got_subcommand("render")) return do_render(said_.render, said_.render_takes, stop);
    if (app.got_subcommand("takes")) return do_takes(app, said_.takes, std::cout, stop.token());
    if (app.got_subcommand("track")) return do_track(said_.track, stop);
    return do_trade(said_.trade, stop);
  }
  // Commands end within two seconds of a signal. A farm's machine may write down how its task ended
  // while a disk is slow; Slurm kills it after half a minute. A model is made without looking for a
  // stop, and would only use up the patience.
  std::optional<std::chrono::milliseconds> patience(const CLI::App& app) const override {
    constexpr std::chrono::milliseconds of_a_model(0), of_a_command(1500), of_a_task(20'000);
    return app.got_subcommand("farm")    ? of_a_task
           : app.got_subcommand("model") ? of_a_model
                                         : of_a_command;
  }
  bool waits(const CLI::App&) const override { return false; }
  std::optional<Supervision> supervision(const CLI::App& app) const override {
    const auto written = written_by(app, said_);
    if (!written) return std::nullopt;
    Supervision supervision;
    supervision.folders = written->drafts;
    if (app.got_subcommand("farm") && app.get_subcommand("farm")->got_subcommand("task"))
      supervision.when_stopped = [this](pid_t task, const std::string& words) {
        return farm::end_stopped_task(said_.farm.task, farm::this_machine(), task, words);
      };
    return supervision;
  }
  void confine(const CLI::App& app) const override {
    if (const auto written = written_by(app, said_); written->reach) confine_to(*written->reach);
  }

  CommandLine said_;
};

}  // namespace

int main(int argc, char** argv) {
  return Previz().main(argc, argv);
}
