// Makes files that are whole or not there, also after a power cut: each is written beside its
// place, synced, then renamed into it, and its name is synced. (For text that is already in memory
// use session::replace_file.)
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>

namespace previz::output {

// No picture of more pixels is read: a small file can claim to hold any number.
inline constexpr std::size_t most_pixels = std::size_t{1} << 28;

// Returns the name that `write_whole` and the video writer use until a file is finished:
// "<path>.part".
std::filesystem::path unfinished_name(const std::filesystem::path& path);

// Whether a file must be there after a power cut. One that another replaces a second later need
// not, and the disk that takes are written to is not made to wait for it.
enum class Sync { yes, no };

// Calls `write` with the unfinished name, then syncs that file to disk and renames it to `path`.
// If `write` throws, the unfinished file is removed and the exception passes on. Throws
// previz::Error naming the file if it cannot be synced or renamed.
void write_whole(const std::filesystem::path& path,
                 const std::function<void(const std::filesystem::path& unfinished)>& write,
                 Sync sync = Sync::yes);

// Syncs and renames an unfinished file that somebody else wrote. Throws as write_whole() does.
void finish(const std::filesystem::path& unfinished, const std::filesystem::path& path);

}  // namespace previz::output
