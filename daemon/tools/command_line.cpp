#include "daemon/tools/command_line.hpp"

#include <CLI/CLI.hpp>
#include <string>

#include "daemon/core/program/options.hpp"
#include "daemon/tools/post/sample_ranges.hpp"
#include "daemon/tools/trade/axes.hpp"
#include "drivers/error.hpp"

namespace previz::tools {
namespace {

// Adds the options that decide what pictures are made of a take; `out` describes --out.
void add_render_options(CLI::App& command, post::RenderOptions& options, const std::string& out) {
  command.add_option("--set", options.set_file, "Set file, instead of the session's own");
  add_with(command, options.with);
  add_any_paths(command, options.any_paths);
  command.add_option_function<std::string>(
      "--frames", [&](const std::string& text) { options.frames = post::parse_frame_range(text); },
      "Frames to render: 7, 3-9 or 3- (default: all)");
  command
      .add_option("--scale", options.scale,
                  "Size of the pictures, relative to the film camera's; smaller is quicker")
      ->check(CLI::Range(0.05, 1.0))
      ->capture_default_str();
  command.add_option("--spp", options.samples, "Samples per pixel (default: quality.samples)")
      ->check(CLI::Range(1, 1'000'000));
  add_choice(command, "--adaptive,!--even", options.adaptive,
             "Spend more samples where the picture is noisy, or the same number in every "
             "pixel (default: quality.adaptive)");
  add_choice(command, "--denoise,!--noisy", options.denoise,
             "Remove noise from the composite, or leave it (default: quality.denoise)");
  command
      .add_option("--neighbours", options.neighbours,
                  "Average a denoised picture with this many frames on each side; 0: every frame "
                  "stands alone (default: quality.neighbours)")
      ->check(CLI::Range(0, 4));
  command
      .add_option("--memory", options.memory,
                  "Memory of the computer that may be taken, as 8GB; what needs more works in "
                  "scratch files (default: quality.memory_mb)")
      ->transform(CLI::AsSizeValue(true));
  command.add_option("--scratch", options.scratch,
                     "Folder for scratch files, on a local disk (default: $TMPDIR, or /var/tmp)");
  command
      .add_option(
          "--error", options.error,
          "Add samples until the error is this fraction of the picture's brightness (default: "
          "quality.error)")
      ->check(CLI::Range(0.0, 1.0));
  command
      .add_option("--seconds", options.seconds,
                  "Add samples for this many seconds per frame (default: quality.seconds)")
      ->check(CLI::Range(0.0, 86400.0));
  add_choice(command, "--hide-tags,!--show-tags", options.hides_tags,
             "Remove the printed tags from the pictures, or leave them in (default: as it was "
             "recorded, or tags.hide)");
  command.add_option("--seed", options.seed, "Random seed (default: the set file's)");
  command
      .add_option_function<std::string>(
          "--estimator",
          [&](const std::string& name) {
            options.estimator =
                name == "paired" ? set::Estimator::paired : set::Estimator::difference;
          },
          "Estimator (default: the set file's)")
      ->check(CLI::IsMember({"paired", "difference"}));
  command.add_option("--out", options.directory, out);
  command.add_flag_callback(
      "--no-exr", [&] { options.exr = false; }, "No EXR files");
  command.add_flag_callback(
      "--no-png", [&] { options.png = false; }, "No PNG files (they are still made for the video)");
  command.add_flag_callback(
      "--no-video", [&] { options.video = false; }, "No review video");
  command.add_flag("--force", options.force, "Render finished frames again");
  add_device_options(command, options.device);
}

void add_render(CLI::App& app, post::RenderOptions& options,
                std::optional<post::WhichTakes>& takes) {
  CLI::App& command = *app.add_subcommand("render", "Composite every frame of a recorded session");
  command
      .add_option("session", options.session,
                  "Session folder; with --good or --all, a folder of takes")
      ->required();
  CLI::Option* good = command.add_flag_callback(
      "--good", [&] { takes = post::WhichTakes::good; }, "Render every take that is marked good");
  command
      .add_flag_callback(
          "--all", [&] { takes = post::WhichTakes::all; }, "Render every take of the folder")
      ->excludes(good);
  add_render_options(
      command, options,
      "Folder for the pictures; with --good or --all, one subfolder per take (default: "
      "the set's output.directory, one subfolder per take)");
  command.add_option_function<std::string>(
      "--sample-range",
      [&](const std::string& text) { options.sample_range = post::parse_sample_range(text); },
      "Render only one of several equal ranges of every frame's samples, 2/4 for the second of "
      "four, and write their sums; previz merge makes the pictures");
}

void add_merge(CLI::App& app, post::RenderOptions& options) {
  CLI::App& command = *app.add_subcommand(
      "merge", "Make the pictures of what render --sample-range has made on several computers");
  command.add_option("session", options.session, "Session folder")->required();
  command
      .add_option("folders", options.sums_from,
                  "Folders of render --sample-range, at least one for each range")
      ->required();
  add_render_options(command, options,
                     "Folder for the pictures (default: the set's output.directory, one subfolder "
                     "per take)");
}

void add_import(CLI::App& app, exchange::ImportOptions& options) {
  CLI::App& command = *app.add_subcommand("import", "Make a take of your own footage");
  command.add_option("description", options.description, "FRAMES.json")->required();
  command.add_option("session", options.session, "Session folder to create")->required();
}

void add_export(CLI::App& app, exchange::ExportOptions& options) {
  CLI::App& command =
      *app.add_subcommand("export", "Write a take's camera for USD and Nuke, with its scene");
  command.add_option("session", options.session, "Session folder")->required();
  command.add_option("directory", options.directory, "Folder for the files")->required();
  command.add_option("--set", options.set_file, "Set file, instead of the session's own");
  add_any_paths(command, options.any_paths);
}

void add_track(CLI::App& app, exchange::TrackOptions& options) {
  CLI::App& command =
      *app.add_subcommand("track", "Find the camera in every frame of a take, without rendering");
  command.add_option("session", options.session, "Session folder")->required();
  command.add_option("--set", options.set_file, "Set file, instead of the session's own");
  command.add_option("--out", options.out, "File for the poses, one JSON line per frame");
  add_any_paths(command, options.any_paths);
}

void add_model(CLI::App& app, model::ModelOptions& options) {
  CLI::App& command = *app.add_subcommand(
      "model", "Make the phantom of the real scene, from tags and points marked in pictures");
  command.add_option("footage", options.footage, "Session, folder of pictures, or video")
      ->required();
  CLI::Option* const parts = command.add_option(
      "--parts", options.parts_file,
      "File of the scene's planes, boxes, cylinders and scans, and of the marked points "
      "(default: the boxes that were marked on the rig while the session was recorded)");
  CLI::Option* const pictures = command
                                    .add_option("--pictures", options.pictures,
                                                "Only write pictures to mark points in, and a file "
                                                "of parts to fill in, into this folder")
                                    ->excludes(parts);
  command.add_option("--set", options.set_file,
                     "Set file with the tags and the film camera's lens (default: the session's)");
  command
      .add_option("--out", options.out,
                  "File of the model, .glb (default: as the file of parts is named; without "
                  "one, as the session, beside the set file)")
      ->excludes(pictures);
  command
      .add_option("--overlay", options.overlay,
                  "Folder for the marked pictures with the model drawn over them")
      ->excludes(pictures);
  command
      .add_flag("--write", options.write,
                "Add the model to the set file; keeps the old file beside it")
      ->excludes(pictures);
  command.add_flag("--grey", options.grey, "Do not measure the colours of its faces");
  command
      .add_flag("--tags-only", options.tags_only,
                "The model is the printed tags alone, with what is under them: for a set whose "
                "phantom is made elsewhere and whose tags are to be hidden")
      ->excludes(pictures);
  add_device_options(command, options.device);
}

void add_trade(CLI::App& app, trade::TradeOptions& options) {
  CLI::App& command =
      *app.add_subcommand("trade", "Measure error against render time: a table and a page");
  command
      .add_option("session", options.source.set_or_session,
                  "Session folder, or set file (uses the take that it replays, or its newest)")
      ->required();
  command.add_option("--set", options.source.set_file, "Set file, instead of the session's own");
  add_any_paths(command, options.source.any_paths);
  command.add_option("--fps", options.fps,
                     "Frame rate for the live picture (default: quality.fps, or 25)");
  command.add_option_function<std::string>(
      "--error", [&](const std::string& text) { options.error = trade::parse_share(text); },
      "Target error for refine and render: 2% or 0.02 (default: 2%)");
  options.answers = true;
  command.add_option("--frame", options.frame, "Frame to use (default: the first tracked)");
  command.add_option("--out", options.directory, "Folder for trade.csv and trade.html");
  std::string axes;
  for (const std::string& name : trade::axis_names()) add_to_list(axes, name);
  command.add_option("--axes", options.axes, "What to vary (default: everything): " + axes)
      ->delimiter(',');
  options.minutes = 5;
  command
      .add_option("--minutes", options.minutes,
                  "Time that it may take; what is not measured by then is named on the page")
      ->capture_default_str();
  command.add_flag("--anew", options.anew,
                   "Measure everything, also what the last table in the folder already has");
  command
      .add_option("--scale", options.scale, "Size of the pictures, relative to the film camera's")
      ->capture_default_str();
  command.add_option("--samples", options.samples, "Samples per pixel to try")
      ->delimiter(',')
      ->capture_default_str();
  command.add_option(
      "--reference-samples", options.reference_samples,
      "Samples per pixel of the converged picture (default: 256 times the largest of --samples)");
  command.add_option("--rounds", options.rounds, "Measurements per setting")->capture_default_str();
  add_device_options(command, options.device);
}

}  // namespace

void add_commands(CLI::App& app, CommandLine& said) {
  add_general(app, said.log_level);
  add_render(app, said.render, said.render_takes);
  add_merge(app, said.merge);
  add_check(app, said.check);
  add_import(app, said.import_session);
  add_export(app, said.export_take);
  add_track(app, said.track);
  add_trade(app, said.trade);
  calibrate::add_calibrate(app, said.calibrate);
  add_model(app, said.model);
  print::add_print(app, said.print);
  farm::add_farm(app, said.farm, [](CLI::App& command, post::RenderOptions& options) {
    add_render_options(command, options,
                       "Folder for the pictures, with a subfolder for each of several takes "
                       "(default: the set's output.directory)");
  });
  add_takes(app, said.takes);
  refuse_what_is_no_number(app);
}

}  // namespace previz::tools
