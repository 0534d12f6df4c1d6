// Options that several commands of previzd and previz have, and what holds for all options.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "daemon/core/check/check.hpp"
#include "daemon/core/render/device/gpu.hpp"

namespace CLI {
class App;
}

namespace previz {

// Adds what the command line of both programs has: --version and --log-level, and that a command is
// needed. The program is named as `app` is.
void add_general(CLI::App& app, std::string& log_level);

// Adds a pair of flags, "--yes,!--no"; `choice` stays empty if neither is given.
void add_choice(CLI::App& command, const std::string& flags, std::optional<bool>& choice,
                const std::string& what);
void add_device_options(CLI::App& command, render::DeviceOptions& device);
void add_any_paths(CLI::App& command, bool& any_paths);
void add_with(CLI::App& command, std::optional<std::filesystem::path>& with);

// Adds the command `check`, which both programs have: a set is checked on the rig, and a take where
// its pictures are made.
void add_check(CLI::App& app, check::CheckOptions& options);

// Lets no option of `app` and its commands take NaN or an infinity: a range lets NaN pass, as no
// comparison with it holds, and what is computed with it is lost.
void refuse_what_is_no_number(CLI::App& app);

// Returns "did you mean --hide-tags?" for the first option that `app` was given and does not know,
// if it has one of a similar name; otherwise "". `app` has refused what it parsed last.
std::string meant_option(const CLI::App& app);

}  // namespace previz
