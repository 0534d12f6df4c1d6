// Knows where each command writes, which is all that its libraries may write to.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "daemon/tools/command_line.hpp"

namespace CLI {
class App;
}

namespace previz::tools {

struct Written {
  // What it may change, with all that is below; absent: it is not confined, because it starts
  // programs.
  std::optional<std::vector<std::filesystem::path>> reach;
  std::vector<std::filesystem::path> drafts;  // folders of what it makes, which may not exist yet
};

// Returns where the command writes that was parsed; nothing for those that read no files of others:
// they need no process of their own.
std::optional<Written> written_by(const CLI::App& app, const CommandLine& said);

}  // namespace previz::tools
