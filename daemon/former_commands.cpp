#include "daemon/former_commands.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <string>
#include <string_view>
#include <system_error>

namespace previz {
namespace {

constexpr std::array commands = {"calibrate", "export", "farm",  "import", "merge", "model",
                                 "print",     "render", "takes", "track",  "trade"};

}  // namespace

const char* former_command(int argc, const char* const* argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word == "--log-level")
      ++i;  // and its value
    else if (!word.starts_with('-')) {
      const auto found = std::ranges::find(commands, word);
      return found == commands.end() ? nullptr : *found;
    }
  }
  return nullptr;
}

int run_former_command(const char* command, char** argv) {
  std::error_code unknown;
  const std::filesystem::path own = std::filesystem::read_symlink("/proc/self/exe", unknown);
  const std::string previz = own.parent_path() / "previz";
  std::cerr << "previzd: `previzd " << command << "` is now `previz " << command
            << "`; the old name works in this release only" << std::endl;
  ::execv(previz.c_str(), argv);
  const bool is_missing = errno == ENOENT;
  std::cerr << "previzd: " << previz << ": " << std::strerror(errno);
  if (is_missing) std::cerr << "; install the package previz-tools, which has it";
  std::cerr << std::endl;
  return 1;
}

}  // namespace previz
