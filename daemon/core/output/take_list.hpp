// Lists the takes that are on the disk, as far as each says what it is.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "daemon/core/session/summary.hpp"

namespace previz::output {

struct ListedTake {
  std::filesystem::path directory;
  session::Summary summary;
  std::uintmax_t bytes = 0;          // of its own files
  bool may_be_in_recording = false;  // the rig records it, or did so when its computer went down
  std::string fault;  // why its session.toml cannot be read; the summary is then empty
  std::vector<std::string> strangers;  // as session::strangers_in() returns them
};

// Returns whether what lies in a folder of takes may be one, by its name. What is hidden, and
// lost+found of an ext4 disk, belongs to others, and often nobody else may look into it; no take is
// named so.
bool may_be_take(const std::filesystem::path& directory);

// Returns the take in this folder. Throws previz::Error if it is not a take, and says what a folder
// of takes is if it is one.
ListedTake listed_take(const std::filesystem::path& directory);

// Returns the takes in these folders, each folder's by name with the numbers in names by value. A
// folder that is not there has none. Throws previz::Error if one cannot be read.
std::vector<ListedTake> list_takes(const std::vector<std::filesystem::path>& folders);

// Returns the folder without a slash at its end, so that it has a name.
std::filesystem::path named(const std::filesystem::path& directory);

}  // namespace previz::output
