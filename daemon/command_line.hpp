// Defines the command line of previzd: its subcommands and their options. The program parses with
// it, and the manual page and the shell completion are printed from it.
#pragma once

#include <filesystem>
#include <string>

#include "daemon/calibrate/command_line.hpp"
#include "daemon/exchange/camera_track.hpp"
#include "daemon/exchange/import.hpp"
#include "daemon/post/render.hpp"
#include "daemon/print/command_line.hpp"
#include "daemon/rig/live.hpp"
#include "daemon/trade/trade.hpp"

namespace previz {

struct CommandLine {
  std::string log_level = "info";
  post::RenderOptions render;
  rig::LiveOptions run;
  std::filesystem::path check;
  bool learn = false, rules = false;  // of devices
  exchange::ImportOptions import_session;
  exchange::ExportOptions export_take;
  trade::TradeOptions trade;
  calibrate::Commands calibrate;
  print::Commands print;
};

// Adds all subcommands and options to `app`, which writes what it parses into `said`; `said` must
// outlive `app`.
void add_commands(CLI::App& app, CommandLine& said);

}  // namespace previz
