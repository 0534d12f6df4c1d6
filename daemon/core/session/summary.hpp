// Says what a session holds without reading its pictures, and names the files that it consists of.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/core/session/records.hpp"

namespace previz::session {

struct Summary {
  SessionInfo info;
  bool closed = false;  // the recording came to an orderly end
  std::string fault;    // why it did not, where that is known
  Losses lost;
  std::uint64_t frames = 0, light_frames = 0;  // of the observer and of the light camera
  double seconds = 0;                          // from the observer's first frame to its last
};

// Reads session.toml and the lines of the frames. Throws previz::Error naming the file (and line)
// if session.toml is missing or cannot be understood.
Summary summary_of(const std::filesystem::path& directory);

// Returns the session's own files, in the order of their paths, which are relative to its folder:
// session.toml, the videos and the lines beside them, and in assets/ the files that are named by
// their content. Whatever else lies in the folder is not the session's, and neither is a link.
std::vector<std::filesystem::path> own_files(const std::filesystem::path& directory);
// Returns, in words that begin with its name, what has the name of one of the session's own files
// and is a link, a folder, a pipe or a device: nobody opens it, and no copy has it. Both throw
// previz::Error if the folder cannot be listed.
std::vector<std::string> strangers_in(const std::filesystem::path& directory);

}  // namespace previz::session
