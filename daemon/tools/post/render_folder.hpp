// Knows where the pictures of a take go, and how many of them are there.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "daemon/core/output/take_list.hpp"

namespace previz::post {

// Returns the folder for a take's pictures if the command line names none: the set's
// output.directory if that lies in the take's own folder, or the session was not recorded on a rig;
// otherwise a folder in it that is named as the take's, so that each take has one of its own.
std::filesystem::path render_folder(const std::filesystem::path& session, bool is_take,
                                    const std::filesystem::path& output_directory);

// Returns how many frames of the take are rendered in the folder that its own set says; nothing if
// its set cannot be read.
std::optional<std::uint64_t> rendered_frames(const output::ListedTake& take);

}  // namespace previz::post
