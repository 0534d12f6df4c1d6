// Writes what buttons have changed into the text of a set file.
#pragma once

#include <string>

#include "daemon/core/pipeline/edits.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::rig {

// Returns the set file's text with the changes in the keys that say so: an object's position_m,
// rotation_deg and scale, or its world_from_file, and its variant; a lamp's gain_mixed and tint; a
// [[captured_light]] for each found lamp that was changed; whether tags are hidden. Everything else
// of the text stays. `set` is what the text means. Lengths are rounded to a micrometre and angles
// to a ten-thousandth of a degree. Throws previz::Error if the text cannot be changed.
std::string with_edits(const std::string& text, const set::Set& set, const pipeline::Edits& edits);

}  // namespace previz::rig
