// The tracking's part of `previzd check`.
#pragma once

#include <iosfwd>

#include "daemon/core/set/check.hpp"

namespace previz::tracking {

// Finds tag maps that make no tracker, and remarks on sets in which no pose can be found.
void check(const set::CheckedSet& checked, set::Findings& findings);

// Prints the tags, those of carriers too.
void describe(const set::Tracking& tracking, std::ostream& out);

}  // namespace previz::tracking
