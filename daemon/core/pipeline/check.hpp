// The light pipeline's part of `previzd check`.
#pragma once

#include "daemon/core/set/check.hpp"

namespace previz::pipeline {

// Finds rooms that cannot be opened, and takes whose light nothing can supply.
void check(const set::CheckedSet& checked, set::Findings& findings);

}  // namespace previz::pipeline
