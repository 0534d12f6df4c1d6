// Defines the command line of previzd: its subcommands and their options. The program parses with
// it, and the manual page and the shell completion are printed from it.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "daemon/bench/bench.hpp"
#include "daemon/calibrate/command_line.hpp"
#include "daemon/exchange/camera_track.hpp"
#include "daemon/exchange/import.hpp"
#include "daemon/exchange/take_track.hpp"
#include "daemon/farm/command_line.hpp"
#include "daemon/model/model.hpp"
#include "daemon/post/check.hpp"
#include "daemon/post/render.hpp"
#include "daemon/post/render_takes.hpp"
#include "daemon/print/command_line.hpp"
#include "daemon/rig/live.hpp"
#include "daemon/takes_command.hpp"
#include "daemon/trade/trade.hpp"

namespace previz {

struct CommandLine {
  std::string log_level = "info";
  post::RenderOptions render;
  std::optional<post::WhichTakes> render_takes;  // of the folder that is named
  rig::LiveOptions run;
  post::CheckOptions check;
  bool learn = false, rules = false;  // of devices
  exchange::ImportOptions import_session;
  exchange::ExportOptions export_take;
  exchange::TrackOptions track;
  trade::TradeOptions trade;
  bench::BenchOptions bench;
  calibrate::Commands calibrate;
  model::ModelOptions model;
  print::Commands print;
  TakesCommands takes;
  post::RenderOptions merge;
  farm::Commands farm;
};

// Adds all subcommands and options to `app`, which writes what it parses into `said`; `said` must
// outlive `app`.
void add_commands(CLI::App& app, CommandLine& said);

// Returns "did you mean --hide-tags?" for the first option that `app` was given and does not know,
// if it has one of a similar name; otherwise "". `app` has refused what it parsed last.
std::string meant_option(const CLI::App& app);

}  // namespace previz
