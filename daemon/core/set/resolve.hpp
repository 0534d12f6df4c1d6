// Turns a draft into a set by deciding what no single key can: which form of a pose was meant,
// which keys need or contradict each other, and where files are.
#pragma once

#include <filesystem>

#include "daemon/core/set/origin.hpp"
#include "daemon/core/set/problems.hpp"
#include "daemon/core/set/table.hpp"

namespace previz::set {

// Adds every problem to `problems`; the set is meaningful only if there are none.
Set resolve(Draft draft, const std::filesystem::path& file, const Assets& assets, Origin origin,
            Problems& problems);

}  // namespace previz::set
