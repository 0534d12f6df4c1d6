// From a draft to a set: what no single key can know - which form of a pose was meant, what needs
// or contradicts what, where files are.
#pragma once

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "daemon/set/problems.hpp"
#include "daemon/set/table.hpp"

namespace previz::set {

using Assets = std::vector<std::pair<std::string, std::filesystem::path>>;

// Adds what it finds to `problems`; the set is meaningful only if there are none.
Set resolve(Draft draft, const std::filesystem::path& file, const Assets& assets, Origin origin,
            Problems& problems);

}  // namespace previz::set
