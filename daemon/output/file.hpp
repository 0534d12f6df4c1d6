// Makes files that are whole or not there, also after a power cut: each is written beside its
// place, synced, then renamed into it, and its name is synced. (For text that is already in memory
// use session::replace_file.)
#pragma once

#include <filesystem>
#include <functional>

namespace previz::output {

// Returns the name that `write_whole` and the video writer use until a file is finished:
// "<path>.part".
std::filesystem::path unfinished_name(const std::filesystem::path& path);

// Calls `write` with the unfinished name, then syncs that file to disk and renames it to `path`.
// If `write` throws, the unfinished file is removed and the exception passes on. Throws
// previz::Error naming the file if it cannot be synced or renamed.
void write_whole(const std::filesystem::path& path,
                 const std::function<void(const std::filesystem::path& unfinished)>& write);

// Syncs and renames an unfinished file that somebody else wrote. Throws as write_whole() does.
void finish(const std::filesystem::path& unfinished, const std::filesystem::path& path);

}  // namespace previz::output
