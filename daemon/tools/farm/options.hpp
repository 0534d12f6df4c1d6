// What `previz farm` and its subcommands are asked for.
#pragma once

#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "daemon/tools/farm/job.hpp"
#include "daemon/tools/post/render_options.hpp"

namespace previz::farm {

struct FarmOptions {
  std::vector<std::filesystem::path> takes;
  post::RenderOptions render;                // without a session
  std::optional<std::filesystem::path> job;  // folder; absent: beside the first take's pictures
  Division division;
  Wishes wishes;
  std::optional<bool> on_gpu;  // absent: as this computer's own device is
  bool any_device = false;
  // previzd on the machines: a path, which may be relative to the current folder, or a name that
  // they find in PATH; empty: where this one is
  std::filesystem::path program;
  std::vector<std::string> sbatch;              // arguments for sbatch
  bool dry_run = false;                         // nothing is written or submitted, all is printed
  std::optional<std::filesystem::path> openjd;  // the job becomes this template, not Slurm's
  std::stop_token stop;
};

// A job that is there.
struct JobOptions {
  std::filesystem::path job;
  bool any_paths = false;  // check_paths()
  // For retry().
  std::filesystem::path program;
  std::vector<std::string> sbatch;
  // For print_status().
  bool json = false;
  bool terminal = false;
  std::stop_token stop;
  // For retry(): those that are given replace the plan's, for this submission.
  Wishes wishes = {};
  // For finish(): frames of both kinds of device are taken, whatever the plan says.
  bool any_device = false;
};

}  // namespace previz::farm
