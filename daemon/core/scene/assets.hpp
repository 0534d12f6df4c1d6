// Lists the files that a set refers to.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "daemon/core/set/set.hpp"

namespace previz::scene {

// Returns every file that the set names: the name as written in the set, and the path. Throws
// previz::Error for a glTF file that itself refers to further files, which a session could not
// hold.
std::vector<std::pair<std::string, std::filesystem::path>> assets_of(const set::Set& set);

}  // namespace previz::scene
