#include "daemon/tools/calibrate/command_line.hpp"

#include <CLI/CLI.hpp>
#include <map>

#include "daemon/tools/calibrate/lens/board.hpp"

namespace previz::calibrate {
namespace {

void add_lens_options(CLI::App& command, LensOptions& options) {
  command.add_option("footage", options.footage, "Session, folder of pictures, or video")
      ->required();
  command.add_option("--board", options.board, board_grammar);
  command.add_option("--every", options.every, "Use only every Nth picture")
      ->check(CLI::Range(1, 1'000'000));
  command.add_option("--out", options.table_file,
                     "Write the tables to this file instead of showing them");
  command.add_option("--plot", options.residual_plot, "SVG file for the residuals");
  command.add_flag("--force", options.force, "Accept the calibration even if views are missing");
}

void add_observer(CLI::App& calibrate, LensOptions& options) {
  CLI::App& command = *calibrate.add_subcommand("observer", "The film camera's lens");
  add_lens_options(command, options);
  command.get_option("--board")->required();
  command.add_option("--set", options.set_file, "Set file that --write changes");
  command.add_flag("--write", options.write,
                   "Write the lens to the set file; keeps the old file beside it");
}

void add_light(CLI::App& calibrate, LightOptions& options) {
  CLI::App& command =
      *calibrate.add_subcommand("light", "The light camera's fisheye lens and its pose");
  add_lens_options(command, options);
  command.add_option("--tags", options.tags_set,
                     "Set file with the tags in view, to find its pose");
  command.add_flag("--rotation", options.rotation,
                   "Instead, how the set's environment file is turned, from shadows and shading in "
                   "a session");
  command.add_option("--set", options.set_file,
                     "With --rotation: set file, instead of the session's");
  command.add_flag("--write", options.write,
                   "With --rotation: write it to the set file; keeps the old file beside it");
}

void add_response(CLI::App& calibrate, ResponseOptions& options) {
  CLI::App& command = *calibrate.add_subcommand(
      "response", "A camera's response curve and from which code on it clips, from a bracket");
  command.add_option("footage", options.footage, "Session or folder of pictures")->required();
  command.add_option("--camera", options.camera, "Camera to calibrate")
      ->transform(CLI::CheckedTransformer(std::map<std::string, CameraRole>{
          {"observer", CameraRole::observer}, {"light", CameraRole::light}}));
  command.add_option("--exposures", options.exposures,
                     "File of lines NAME SECONDS (default: the pictures' EXIF)");
  command.add_option("--method", options.method, "debevec or robertson (default: the better one)")
      ->transform(CLI::CheckedTransformer(std::map<std::string, ResponseMethod>{
          {"debevec", ResponseMethod::debevec}, {"robertson", ResponseMethod::robertson}}));
  command.add_option("--out", options.table_file, "Write the table to this file");
}

void add_dark(CLI::App& calibrate, DarkOptions& options) {
  CLI::App& command = *calibrate.add_subcommand(
      "dark", "The light camera's dark level, from pictures with the lens capped");
  command.add_option("footage", options.footage, "Session, folder of pictures, or video")
      ->required();
  command.add_option("--set", options.set_file,
                     "Set file with the camera's response (default: the session's)");
  command.add_option("--out", options.table_file, "Write the table to this file");
}

void add_vignetting(CLI::App& calibrate, VignettingOptions& options) {
  CLI::App& command = *calibrate.add_subcommand(
      "vignetting",
      "The fisheye's light falloff towards its edge, from pictures of an evenly lit surface");
  command.add_option("footage", options.footage, "Session, folder of pictures, or video")
      ->required();
  command.add_option("--set", options.set_file, "Set file with its lens, response and dark level")
      ->required();
  command.add_option("--out", options.table_file, "Write the table to this file");
  command.add_flag("--force", options.force, "Accept the result even if the light was uneven");
}

void add_lens(CLI::App& calibrate, ThinLensOptions& options) {
  CLI::App& command =
      *calibrate.add_subcommand("lens", "The film camera's lens, for depth of field");
  command.add_option("--focal-length", options.focal_length_mm, "Focal length as engraved, mm");
  command.add_option("--f-number", options.f_number, "The f-stop, as on the ring");
  command.add_option("--focus", options.focus_distance_m, "Focus distance, m");
  command.add_option("--sensor-width", options.sensor_width_mm,
                     "Width of the sensor area in the picture, mm");
  command.add_option("--photo", options.photo,
                     "Photograph whose EXIF supplies the values not given");
  command.add_option("--set", options.set_file, "Set file with the film camera's intrinsics");
  command.add_option("--out", options.table_file, "Write the table to this file");
}

void add_from(CLI::App& calibrate, FromOptions& options) {
  CLI::App& command = *calibrate.add_subcommand(
      "from", "A lens that OpenCV, ROS, Kalibr or COLMAP calibrated, from its file");
  command
      .add_option("file", options.file,
                  "OpenCV's YAML, XML or JSON, ROS's camera_info, Kalibr's camchain or COLMAP's "
                  "cameras.txt")
      ->required();
  command
      .add_option("--as", options.as,
                  "Camera that gets the lens: observer or light (default: light for a fisheye, "
                  "observer for a pinhole)")
      ->transform(CLI::CheckedTransformer(std::map<std::string, CameraRole>{
          {"observer", CameraRole::observer}, {"light", CameraRole::light}}));
  command.add_option("--camera", options.camera,
                     "Name or index (from 0) of a camera, if the file has several");
  command.add_option("--size", options.size,
                     "Size of the calibrated picture if the file does not have it: 1920x1080");
  command.add_option("--out", options.table_file, "Write the table to this file");
  command.add_flag("--force", options.force,
                   "Accept the lens although the camera's model is more than 0.1 px off");
}

void add_balance(CLI::App& calibrate, BalanceOptions& options) {
  CLI::App& command = *calibrate.add_subcommand(
      "balance", "Scale and white balance between the two cameras, and the colours of surfaces");
  command.add_option("session", options.session, "Session folder")->required();
  command.add_option("--set", options.set_file, "Set file, instead of the session's own");
  command
      .add_option(
          "--reference", options.references,
          "Materials of real objects of known colour, or \"paper\", the printed tags' white "
          "(default: paper, or all materials alike where no tag is large enough)")
      ->delimiter(',');
  command.add_flag("--write", options.write,
                   "Write the balance to the set file; keeps the old file beside it");
  command.add_option("--frames", options.frames, "Pictures to compare")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  command.add_option("--spp", options.samples, "Samples per pixel")
      ->check(CLI::Range(1, 1'000'000))
      ->capture_default_str();
  command.add_option("--device", options.device.name, "Vulkan device, by part of its name");
  command.add_option("--out", options.table_file,
                     "Write the tables to this file instead of showing them");
}

void add_tags(CLI::App& calibrate, TagsOptions& options) {
  CLI::App& command = *calibrate.add_subcommand(
      "tags", "Tag positions, from a walk past all tags with the film camera");
  command.add_option("footage", options.footage, "Session, folder of pictures, or video")
      ->required();
  command.add_option("--set", options.set_file,
                     "Set file with the film camera's lens and any known tags");
  command.add_option("--size", options.sizes,
                     "Side of the tags' black border, as measured: 80mm, or with exceptions "
                     "80mm,7:120mm (default: the set file's)");
  command.add_option(
      "--origin", options.origin,
      "Tag that defines the world: as in the set file, or else at the origin, face "
      "up, X to its right (default: the set file's first visible tag, or the lowest id)");
  command.add_option("--distance", options.distance,
                     "Distance between the centres of two tags, which sets the scale: 0-3:1.234m "
                     "(default: by the tags' sizes)");
  command.add_option("--family", options.family, "Tag family (default: the set's, or tag36h11)");
  command.add_option("--every", options.every, "Use only every Nth picture")
      ->check(CLI::Range(1, 1'000'000));
  command.add_option("--out", options.table_file,
                     "Write the tables to this file instead of showing them");
  command.add_flag("--write", options.write,
                   "Write the tags to the set file; keeps the old file beside it");
  command.add_flag("--force", options.force, "Accept the map even if pictures are missing");
}

}  // namespace

void add_calibrate(CLI::App& app, Commands& commands) {
  CLI::App& command = *app.add_subcommand(
      "calibrate", "Measure a camera or the tag positions; prints set file tables");
  command.require_subcommand(1);
  add_observer(command, commands.observer);
  add_light(command, commands.light);
  add_response(command, commands.response);
  add_dark(command, commands.dark);
  add_vignetting(command, commands.vignetting);
  add_lens(command, commands.lens);
  add_from(command, commands.from);
  add_balance(command, commands.balance);
  add_tags(command, commands.tags);
}

int do_calibrate(const CLI::App& app, const Commands& commands, std::ostream& out) {
  const CLI::App& command = *app.get_subcommand("calibrate");
  if (command.got_subcommand("observer")) calibrate_observer(commands.observer, out);
  if (command.got_subcommand("light"))
    commands.light.rotation ? calibrate_rotation(commands.light, out)
                            : calibrate_light(commands.light, out);
  if (command.got_subcommand("response")) calibrate_response(commands.response, out);
  if (command.got_subcommand("dark")) calibrate_dark(commands.dark, out);
  if (command.got_subcommand("vignetting")) calibrate_vignetting(commands.vignetting, out);
  if (command.got_subcommand("lens")) calibrate_lens(commands.lens, out);
  if (command.got_subcommand("from")) calibrate_from(commands.from, out);
  if (command.got_subcommand("balance")) calibrate_balance(commands.balance, out);
  if (command.got_subcommand("tags")) calibrate_tags(commands.tags, out);
  return 0;
}

}  // namespace previz::calibrate
