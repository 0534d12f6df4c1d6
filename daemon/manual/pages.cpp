#include "daemon/manual/pages.hpp"

#include <CLI/CLI.hpp>

#include "daemon/command_line.hpp"
#include "daemon/control/request.hpp"
#include "daemon/manual/command.hpp"
#include "daemon/manual/completion.hpp"
#include "daemon/manual/man_page.hpp"
#include "daemon/set/actions.hpp"

namespace previz::manual {
namespace {

std::vector<Command> previzd_commands() {
  CLI::App app{"Path-traced previsualization for a camera rig", "previzd"};
  CommandLine said;
  add_commands(app, said);
  return commands_of(app);
}

std::vector<Command> previzctl_commands() {
  CLI::App app{"Operates a camera rig that runs previzd", "previzctl"};
  control::Request asked;
  control::add_requests(app, asked);
  return commands_of(app);
}

std::string actions_text() {
  std::string text;
  for (const set::Action& action : set::actions())
    text += std::string(action.name) + ": " + action.about + "\n";
  return text;
}

const Chapter service_chapter{"THE SERVICE", R"(
previzd.service runs `previzd run --bus --loop /etc/previzd/set.toml` as the user previz. A set file that is changed is read again, at the latest on `systemctl reload previzd`; one with a mistake leaves the old one running and says why, in the journal and in `previzctl status`.
`journalctl -u previzd` shows what it reports, each line with the priority of its severity: `-p err` leaves the errors.
Members of the group previz may operate the rig with previzctl.
)"};

const Chapter previzd_status{"EXIT STATUS", R"(
0: Done.
1: An error; one line on standard error says which.
2: The command line cannot be understood.
128+N: Stopped by signal N. What was finished is on disk, and a render goes on there when it is called again. (A rig that is stopped has done its work: 0.)
)"};

const Chapter previzd_files{"FILES", R"(
/etc/previzd/set.toml: The set that the service runs; as installed, a demonstration that needs no camera.
/usr/share/previzd/demo: What that demonstration shows.
/usr/share/doc/previzd/examples: A set file to start from, and the reference of every key.
/var/lib/previzd: Takes and pictures, where the set does not say otherwise.
)"};

const Chapter previzctl_status{"EXIT STATUS", R"(
0: Done.
1: Refused, or no rig answers; one line on standard error says why.
2: The command line cannot be understood.
)"};

const Chapter set_description{"DESCRIPTION", R"(
A set file tells previzd everything about one stage: which cameras there are, where the tags hang, what is real and what is not, and how the light is to be. It is TOML. `previzd check FILE` tells every mistake in it with its line.
Lengths are in the unit that a key's name ends in; the world is right-handed, Z up; colours are linear Rec. 709. A table in double brackets stands once for each thing it describes. Below, a key stands with its default.
)"};

Chapter see_also(const std::string& pages) {
  return {"SEE ALSO", pages};
}

}  // namespace

std::vector<Page> man_pages() {
  return {{"previzd.8", man_page(previzd_commands(), 8,
                                 {service_chapter, previzd_files, previzd_status,
                                  see_also("previzctl(1), previz-set(5)")})},
          {"previzctl.1", man_page(previzctl_commands(), 1,
                                   {{"ACTIONS", actions_text()},
                                    previzctl_status,
                                    see_also("previzd(8), previz-set(5)")})},
          {"previz-set.5", set_man_page(set_description, see_also("previzd(8), previzctl(1)"))}};
}

std::vector<Page> bash_completions() {
  return {{"previzd", bash_completion(previzd_commands())},
          {"previzctl", bash_completion(previzctl_commands())}};
}

}  // namespace previz::manual
