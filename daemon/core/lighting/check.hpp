// The environment light's part of `previzd check`.
#pragma once

#include <iosfwd>

#include "daemon/core/set/check.hpp"

namespace previz::lighting {

// Finds environments that cannot be loaded, and remarks on what is odd in them.
void check(const set::CheckedSet& checked, set::Findings& findings);

// Prints where the environment light comes from, and as what it lights the set.
void describe(const set::Set& set, std::ostream& out);

}  // namespace previz::lighting
