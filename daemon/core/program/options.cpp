#include "daemon/core/program/options.hpp"

#include <CLI/CLI.hpp>
#include <cmath>
#include <vector>

#include "daemon/core/set/problems.hpp"

namespace previz {

void add_general(CLI::App& app, std::string& log_level) {
  app.set_version_flag("--version", app.get_name() + " " PREVIZ_VERSION, "Print the version");
  app.require_subcommand(1);
  app.add_option("--log-level", log_level, "Lowest severity that is logged")
      ->check(CLI::IsMember({"info", "warning", "error"}))
      ->capture_default_str();
}

// CLI11's own for an optional would say no if neither was given.
void add_choice(CLI::App& command, const std::string& flags, std::optional<bool>& choice,
                const std::string& what) {
  command.add_flag_function(
      flags, [&choice](std::int64_t count) { choice = count > 0; }, what);
}

void add_device_options(CLI::App& command, render::DeviceOptions& device) {
  device.cache = render::cache_folder();
  command.add_option("--device", device.name, "Vulkan device, by part of its name");
  add_choice(command, "--hardware-rays,!--no-hardware-rays", device.hardware_rays,
             "Trace rays in hardware, or not; otherwise a graphics card does so where it can and "
             "quality.hardware_rays allows it");
  command.add_flag("--validation", device.validation,
                   "Log the messages of Vulkan's validation layer");
}

void add_any_paths(CLI::App& command, bool& any_paths) {
  command.add_flag("--any-paths", any_paths,
                   "Allow the session's own set file to use paths outside the session");
}

void add_with(CLI::App& command, std::optional<std::filesystem::path>& with) {
  command.add_option(
      "--with", with,
      "File of quality, estimator and lighting keys that override the set file, as trade "
      "writes it");
}

void refuse_what_is_no_number(CLI::App& app) {
  const auto refusal = [](const std::string& text) -> std::string {
    double number = 0;
    if (!CLI::detail::lexical_cast(text, number) || std::isfinite(number)) return {};
    return text + " is not a number that can be used; give a finite one";
  };
  for (CLI::Option* option : app.get_options([](CLI::Option*) { return true; }))
    if (option->get_type_name().starts_with("FLOAT")) option->check(CLI::Validator(refusal, ""));
  for (CLI::App* command : app.get_subcommands([](CLI::App*) { return true; }))
    refuse_what_is_no_number(*command);
}

std::string meant_option(const CLI::App& app) {
  for (const CLI::App* command : app.get_subcommands())
    if (std::string meant = meant_option(*command); !meant.empty()) return meant;
  std::vector<std::string> known;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) known.push_back(name);
  for (const std::string& given : app.remaining()) {
    if (!given.starts_with("--")) continue;
    const std::string name = given.substr(2, given.find('=') - 2);
    if (const std::string near = set::nearest(name, known); !near.empty())
      return "did you mean --" + near + "?";
  }
  return "";
}

void add_check(CLI::App& app, check::CheckOptions& options) {
  CLI::App& command =
      *app.add_subcommand("check", "List the mistakes in a set file or, if none, what it needs");
  command.add_option("set-or-session", options.set_or_session, "Set file or session folder")
      ->required();
  command.add_option("--set", options.set_file, "Set file, instead of the session's own");
}

}  // namespace previz
