// Writes what is whole of a damaged session into a new one.
#pragma once

#include <cstdint>
#include <filesystem>
#include <stop_token>
#include <string>
#include <vector>

namespace previz::session {

struct Repair {
  std::uint64_t frames = 0;         // of the observer, in the new session
  std::vector<std::string> lacked;  // what was wrong with the old one, in words
  bool is_complete = false;         // all that was recorded is in the new one
};

// Reads the session `damaged` and changes nothing in it. Writes every frame whose picture and line
// are whole, every line of track.jsonl and events.jsonl that can be understood, and every asset
// that is as it was recorded, into the new folder `repaired`: frames keep their numbers, times and
// samples, and the videos are encoded anew. An event says that it was repaired and from what; where
// something is lost, session.toml has it as its fault, and each lost asset with the reason. The
// folder gets its name when it is whole and on the disk; a stop or an error leaves none. Throws
// previz::Error if `repaired` exists or lies in `damaged`, if session.toml cannot be understood, or
// if no frame can be read.
Repair repair_session(const std::filesystem::path& damaged, const std::filesystem::path& repaired,
                      const std::stop_token& stop = {});

}  // namespace previz::session
