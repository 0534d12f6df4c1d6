// The scene's part of `previzd check`.
#pragma once

#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/check.hpp"

namespace previz::scene {

// Loads the scene; where that fails, finds the problems of each object's file and returns nothing.
std::optional<Scene> check(const set::CheckedSet& checked, set::Findings& findings);

// Returns what a user must know if tags are hidden: those that cannot be, and those of which it is
// not known what is under them.
std::vector<std::string> remarks_on_hidden_tags(const Scene& scene, const set::Set& set);

// Remarks on what was ignored in the files, on lamps that are too bright, and on sets whose picture
// is the plate's.
void remark_on(const Scene& scene, const set::CheckedSet& checked, set::Findings& findings);

// Print the objects with their triangles and variants, and the lamps with their strength.
void describe_objects(const set::Set& set, const Scene& scene, std::ostream& out);
void describe_lamps(const set::CheckedSet& checked, const Scene& scene, std::ostream& out);

}  // namespace previz::scene
