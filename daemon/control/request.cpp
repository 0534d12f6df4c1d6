#include "daemon/control/request.hpp"

#include <CLI/CLI.hpp>

namespace previz::control {

void add_requests(CLI::App& app, Request& asked) {
  app.set_version_flag("--version", "previzctl " PREVIZ_VERSION, "Print the version");
  app.require_subcommand(1);
  const std::string raw = "As D-Bus has it, for scripts: a property a line";
  app.add_subcommand("status", "What the rig is doing")->add_flag("--raw", asked.raw, raw);
  app.add_subcommand("watch", "Status, then every change as it happens")
      ->add_flag("--raw", asked.raw, raw);
  app.add_subcommand("metrics", "Frame rates, drops and latency, as JSON");
  app.add_subcommand("mode", "Switch to a mode")
      ->add_option("mode", asked.mode)
      ->required()
      ->check(CLI::IsMember({"standby", "live", "refine", "review"}));
  app.add_subcommand("record", "Start or end a take")
      ->add_option("on", asked.record)
      ->required()
      ->check(CLI::IsMember({"on", "off"}));
  app.add_subcommand("action", "Do an action, as a button would")
      ->add_option("name", asked.action)
      ->required()
      ->type_name("ACTION");
  app.add_subcommand("actions", "All actions")->add_flag("--names", asked.names_only, "Names only");
  app.add_subcommand("set", "Change the set")
      ->add_option("which", asked.set)
      ->required()
      ->check(CLI::IsMember({"reload", "next", "previous"}));
}

}  // namespace previz::control
