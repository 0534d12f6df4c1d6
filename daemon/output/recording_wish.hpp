// The wish to record, kept on the disk of the takes: it outlives a crash, a power cut, a restart
// and an upgrade, until somebody ends the recording.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace previz::output {

// Writes that this take is being recorded into the folder of takes. Throws previz::Error.
void keep_wish(const std::filesystem::path& takes, const std::string& take);
// Somebody has ended the recording, or it cannot go on. Throws previz::Error.
void drop_wish(const std::filesystem::path& takes);
// Returns the take that was being recorded when the process ended, if one was.
std::optional<std::string> kept_wish(const std::filesystem::path& takes);

}  // namespace previz::output
