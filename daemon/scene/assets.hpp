// The files that a set needs beside it.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "daemon/set/set.hpp"

namespace previz::scene {

// Every file that the set names, as it writes it and where it is. Throws previz::Error for a glTF
// file that itself refers to further files, which a session could not hold.
std::vector<std::pair<std::string, std::filesystem::path>> assets_of(const set::Set& set);

}  // namespace previz::scene
