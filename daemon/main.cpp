// previzd: the subcommands; nothing else.
//
// Exit status: 0 done; 1 an error, one line on standard error says which; 2 the command line cannot
// be understood; 128 + N stopped by signal N (what was finished is on disk, and a render goes on
// there when it is called again).
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <iostream>

#include "daemon/calibrate/command_line.hpp"
#include "daemon/post/camera_track.hpp"
#include "daemon/post/check.hpp"
#include "daemon/post/import.hpp"
#include "daemon/post/render.hpp"
#include "daemon/post/trade.hpp"
#include "daemon/post/trade_page.hpp"
#include "daemon/rig/devices.hpp"
#include "daemon/rig/live.hpp"
#include "daemon/rig/signals.hpp"
#include "drivers/error.hpp"

namespace {

using namespace previz;

// Under systemd the journal adds the time and reads the level from the <N> prefix (sd-daemon(3)).
void start_log(const std::string& level) {
  auto log = spdlog::stderr_color_mt("previzd");
  log->set_level(spdlog::level::from_str(level));
  if (std::getenv("JOURNAL_STREAM")) {
    class Priority final : public spdlog::custom_flag_formatter {
      void format(const spdlog::details::log_msg& message, const std::tm&,
                  spdlog::memory_buf_t& out) override {
        constexpr std::string_view of_level[] = {"<7>", "<7>", "<6>", "<4>", "<3>", "<2>", "<6>"};
        const std::string_view text = of_level[message.level];
        out.append(text.data(), text.data() + text.size());
      }
      std::unique_ptr<custom_flag_formatter> clone() const override {
        return std::make_unique<Priority>();
      }
    };
    auto formatter = std::make_unique<spdlog::pattern_formatter>();
    formatter->add_flag<Priority>('*').set_pattern("%*%v");
    log->set_formatter(std::move(formatter));
  } else {
    log->set_pattern("%H:%M:%S.%e %^%l%$ %v");
  }
  spdlog::set_default_logger(std::move(log));
}

void add_device_options(CLI::App& command, render::DeviceOptions& device) {
  command.add_option("--device", device.name, "Vulkan device whose name contains this");
  command.add_flag("--validation", device.validation, "Vulkan's validation layer, into the log");
}

void add_render(CLI::App& app, post::RenderOptions& options) {
  CLI::App& command = *app.add_subcommand("render", "Composite every frame of a recorded session");
  command.add_option("session", options.session, "Session directory")->required();
  command.add_option("--set", options.set_file, "Set file, instead of the session's own");
  command.add_option_function<std::string>(
      "--frames", [&](const std::string& text) { options.frames = post::parse_frame_range(text); },
      "Observer frames: 7, 3-9 or 3- (default: all)");
  command.add_option("--spp", options.samples, "Samples per pixel (default: quality.samples)")
      ->check(CLI::Range(1, 1'000'000));
  command
      .add_option("--error", options.error,
                  "Go on to this error, over the picture's mean radiance (default: quality.error)")
      ->check(CLI::Range(0.0, 1.0));
  command
      .add_option("--seconds", options.seconds,
                  "Go on for so long a frame (default: quality.seconds)")
      ->check(CLI::Range(0.0, 86400.0));
  command.add_option("--seed", options.seed, "Seed of the random numbers (default: the set's)");
  command
      .add_option_function<std::string>(
          "--estimator",
          [&](const std::string& name) {
            options.estimator =
                name == "paired" ? set::Estimator::paired : set::Estimator::difference;
          },
          "Estimator (default: the set's)")
      ->check(CLI::IsMember({"paired", "difference"}));
  command.add_option("--out", options.directory, "Directory for the pictures");
  command.add_flag_callback(
      "--no-exr", [&] { options.exr = false; }, "No EXR files");
  command.add_flag_callback(
      "--no-png", [&] { options.png = false; }, "No PNG files (the video still needs them)");
  command.add_flag_callback(
      "--no-video", [&] { options.video = false; }, "No review video");
  command.add_flag("--force", options.force, "Render frames again that are there already");
  add_device_options(command, options.device);
}

void add_run(CLI::App& app, rig::LiveOptions& options) {
  CLI::App& command = *app.add_subcommand("run", "Composite live, until the cameras end or Ctrl-C");
  command.add_option("set", options.set_file, "Set file")->required();
  command.add_option("--spp", options.samples, "Samples per pixel (default: quality.samples)")
      ->check(CLI::Range(1, 1'000'000));
  command.add_option("--out", options.directory, "Directory for picture.png and metrics.json");
  command.add_flag("--bus", options.bus, "Serve org.previz.Rig1 on the system bus (previzctl)");
  command.add_flag("--loop", options.loop, "Replayed cameras start again at their end, for ever");
  add_device_options(command, options.device);
}

void add_check(CLI::App& app, std::filesystem::path& set_or_session) {
  CLI::App& command =
      *app.add_subcommand("check", "Say what is wrong with a set, or what it needs");
  command.add_option("set", set_or_session, "Set file or session directory")->required();
}

void add_devices(CLI::App& app, bool& learn) {
  CLI::App& command =
      *app.add_subcommand("devices", "List cameras and buttons by the names a set file takes");
  command.add_flag("--learn", learn,
                   "Print the name of every button that is pressed, until Ctrl-C");
}

void add_import(CLI::App& app, post::ImportOptions& options) {
  CLI::App& command = *app.add_subcommand("import", "Make a session of footage");
  command.add_option("description", options.description, "FRAMES.json")->required();
  command.add_option("session", options.session, "Session directory to make")->required();
}

void add_export(CLI::App& app, post::ExportOptions& options) {
  CLI::App& command =
      *app.add_subcommand("export", "Write a take's camera for USD and Nuke, with its scene");
  command.add_option("session", options.session, "Session directory")->required();
  command.add_option("directory", options.directory, "Directory for the files")->required();
}

void add_trade(CLI::App& app, post::TradeOptions& options) {
  CLI::App& command =
      *app.add_subcommand("trade", "Measure what time buys on a set: a table and a page");
  command.add_option("set", options.set_file, "Set file whose cameras are replayed")->required();
  command.add_option("--frame", options.frame, "Observer frame (default: the first tracked)");
  command.add_option("--out", options.directory, "Directory for trade.csv and trade.html");
  command.add_option("--axes", options.axes, "What to vary (default: everything)")->delimiter(',');
  command.add_option("--scale", options.scale, "Of the observer's size")->capture_default_str();
  command.add_option("--samples", options.samples, "Samples per pixel to try")
      ->delimiter(',')
      ->capture_default_str();
  command.add_option("--reference-samples", options.reference_samples,
                     "Of the converged picture (default: 256 times the most of --samples)");
  command.add_option("--rounds", options.rounds, "How often each is measured")
      ->capture_default_str();
  add_device_options(command, options.device);
}

int do_devices(bool learn, const rig::StopOnSignal& stop) {
  learn ? rig::learn_buttons(std::cout, stop.token()) : rig::list_devices(std::cout);
  return stop.received() ? 128 + stop.received() : 0;
}

int do_import(const post::ImportOptions& options) {
  const post::ImportReport report = post::import_session(options);
  for (const std::string& note : report.notes) std::cout << note << "\n";
  std::cout << options.session.string() << ": " << report.observer_frames << " observer frames, "
            << report.light_frames << " light frames, " << report.poses << " poses, "
            << report.assets << " assets, " << report.bytes / 1'000'000.0 << " MB" << std::endl;
  return 0;
}

int do_render(post::RenderOptions& options, const rig::StopOnSignal& stop) {
  options.stop = stop.token();
  options.terminal = isatty(STDOUT_FILENO) != 0;
  const post::RenderReport report = post::render_session(options, std::cout);
  std::cout << report.directory.string() << ": " << report.frames.size() << " frames"
            << (report.interrupted ? "; stopped, the same command goes on from here" : "")
            << std::endl;
  return report.interrupted ? 128 + stop.received() : 0;
}

int do_trade(post::TradeOptions& options, const rig::StopOnSignal& stop) {
  options.stop = stop.token();
  options.terminal = isatty(STDOUT_FILENO) != 0;
  const post::TradeReport report = post::run_trade(options, std::cout);
  if (report.interrupted) return 128 + stop.received();
  std::cout << "\n";
  for (const post::TradeFrontPoint& at : post::told_front_of(report))
    std::cout << post::front_words(report, at) << "\n";
  std::cout << "\n" << report.csv.string() << "\n" << report.page.string() << std::endl;
  return 0;
}

int do_run(rig::LiveOptions& options, const rig::StopOnSignal& stop) {
  options.stop = stop.token();
  std::cout << to_json(rig::run_live(options, std::cout));
  return stop.received() ? 128 + stop.received() : 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"previzd: path-traced previsualization for a camera rig"};
  app.set_version_flag("--version", "previzd " PREVIZ_VERSION);
  app.require_subcommand(1);
  std::string level = "info";
  app.add_option("--log-level", level, "What goes to the log")
      ->check(CLI::IsMember({"trace", "debug", "info", "warning", "error"}))
      ->capture_default_str();
  post::RenderOptions render_options;
  rig::LiveOptions live_options;
  std::filesystem::path checked;
  bool learn = false;
  post::ImportOptions import_options;
  post::ExportOptions export_options;
  post::TradeOptions trade_options;
  calibrate::Commands calibrate_options;
  try {
    add_render(app, render_options);
    add_run(app, live_options);
    add_check(app, checked);
    add_devices(app, learn);
    add_import(app, import_options);
    add_export(app, export_options);
    add_trade(app, trade_options);
    calibrate::add_calibrate(app, calibrate_options);
    app.parse(argc, argv);
    start_log(level);
    const rig::StopOnSignal stop;
    if (app.got_subcommand("check")) return post::check_set(checked, std::cout);
    if (app.got_subcommand("calibrate"))
      return calibrate::do_calibrate(app, calibrate_options, std::cout);
    if (app.got_subcommand("devices")) return do_devices(learn, stop);
    if (app.got_subcommand("export")) return post::export_take(export_options, std::cout), 0;
    if (app.got_subcommand("import")) return do_import(import_options);
    if (app.got_subcommand("render")) return do_render(render_options, stop);
    if (app.got_subcommand("trade")) return do_trade(trade_options, stop);
    return do_run(live_options, stop);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    std::cerr << "previzd: " << error.what() << std::endl;
    return 1;
  }
}
