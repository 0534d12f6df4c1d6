#include "daemon/tools/takes_command.hpp"

#include <CLI/CLI.hpp>

namespace previz::tools {
namespace {

CLI::App& add_takes_command(CLI::App& takes, const char* name, const char* about,
                            post::Paths& paths) {
  CLI::App& command = *takes.add_subcommand(name, about);
  command.add_option("take", paths, "Folders of takes")->required();
  return command;
}

}  // namespace

void add_takes(CLI::App& app, TakesCommands& commands) {
  CLI::App& takes =
      *app.add_subcommand("takes", "List, mark, check, copy and delete recorded takes");
  takes.require_subcommand(1);
  takes.add_subcommand("list", "List the takes in a folder, and what each is missing")
      ->add_option("place", commands.listed, "Folders of takes, or set files that name them")
      ->required();
  add_takes_command(takes, "mark", "Mark takes as good", commands.marked)
      .add_flag("--not", commands.not_good, "Remove the mark");
  add_takes_command(takes, "check", "Read takes from end to end and list what is damaged",
                    commands.checked)
      .add_option("--repair", commands.repaired,
                  "Write what is whole of a damaged take into this folder, as a new take of its "
                  "name; the damaged one stays as it is");
  CLI::App& copy = add_takes_command(
      takes, "copy", "Copy takes with checksums, and read the copies back", commands.copied.takes);
  copy.add_option("--to", commands.copied.folder, "Folder for the copies")->required();
  add_takes_command(takes, "delete", "Delete these takes, and nothing else", commands.deleted)
      .add_flag("--good", commands.also_good, "Also those that are marked good");
}

int do_takes(const CLI::App& app, const TakesCommands& commands, std::ostream& out,
             const std::stop_token& stop) {
  const CLI::App& takes = *app.get_subcommand("takes");
  if (takes.got_subcommand("check"))
    return commands.repaired.empty()
               ? post::check_takes(commands.checked, out, stop)
               : post::repair_takes({commands.checked, commands.repaired}, out, stop);
  if (takes.got_subcommand("copy")) return post::copy_takes(commands.copied, out, stop);
  if (takes.got_subcommand("list")) post::list_takes(commands.listed, out);
  if (takes.got_subcommand("mark")) post::mark_takes(commands.marked, !commands.not_good, out);
  if (takes.got_subcommand("delete")) post::delete_takes(commands.deleted, commands.also_good, out);
  return 0;
}

}  // namespace previz::tools
