// Defines the command line of previz: its subcommands and their options. The program parses with
// it, and the manual page and the shell completion are printed from it.
#pragma once

#include <optional>
#include <string>

#include "daemon/core/check/check.hpp"
#include "daemon/tools/calibrate/command_line.hpp"
#include "daemon/tools/exchange/camera_track.hpp"
#include "daemon/tools/exchange/import.hpp"
#include "daemon/tools/exchange/take_track.hpp"
#include "daemon/tools/farm/command_line.hpp"
#include "daemon/tools/model/model.hpp"
#include "daemon/tools/post/render.hpp"
#include "daemon/tools/post/render_takes.hpp"
#include "daemon/tools/print/command_line.hpp"
#include "daemon/tools/takes_command.hpp"
#include "daemon/tools/trade/trade.hpp"

namespace CLI {
class App;
}

namespace previz::tools {

struct CommandLine {
  std::string log_level = "info";
  post::RenderOptions render;
  std::optional<post::WhichTakes> render_takes;  // of the folder that is named
  post::RenderOptions merge;
  check::CheckOptions check;
  exchange::ImportOptions import_session;
  exchange::ExportOptions export_take;
  exchange::TrackOptions track;
  trade::TradeOptions trade;
  calibrate::Commands calibrate;
  model::ModelOptions model;
  print::Commands print;
  TakesCommands takes;
  farm::Commands farm;
};

// Adds all subcommands and options to `app`, which writes what it parses into `said`; `said` must
// outlive `app`.
void add_commands(CLI::App& app, CommandLine& said);

}  // namespace previz::tools
