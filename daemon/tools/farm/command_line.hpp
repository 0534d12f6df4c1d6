// Parses the command line of `previz farm` and its subcommands.
#pragma once

#include <functional>
#include <ostream>
#include <stop_token>

#include "daemon/tools/farm/farm.hpp"
#include "daemon/tools/farm/task.hpp"

namespace CLI {
class App;
}

namespace previz::farm {

struct Commands {
  FarmOptions farm;
  JobOptions job;  // of status, cancel, retry and finish
  TaskOptions task;
};

// Adds `farm` with its subcommands to `app`; `commands` must outlive it. `add_render_options` adds
// those that decide what pictures are made of a take.
void add_farm(CLI::App& app, Commands& commands,
              const std::function<void(CLI::App&, post::RenderOptions&)>& add_render_options);
// Runs what the command line asked for; returns the program's exit status. `terminal`: `out` is
// one.
int do_farm(const CLI::App& app, Commands& commands, bool terminal, std::ostream& out,
            const std::stop_token& stop);

}  // namespace previz::farm
