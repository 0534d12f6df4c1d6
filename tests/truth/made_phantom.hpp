// Makes the phantom of a set from its own pictures, as a crew does: by marks that a person made in
// them (parts/NAME.toml).
#pragma once

#include <filesystem>
#include <ostream>

#include "tests/truth/truth_set.hpp"

namespace previz::truth {

// Makes it of the session that was written of the set (write_take), with its colours, in
// DIRECTORY/made.glb, and reports on `out` what `previz model` does, and how far the corners of
// its boxes are from the nearest ones of the set's own phantom. Returns the file. Throws
// previz::Error if the set has no marks.
std::filesystem::path make_phantom(const TruthSet& set, const std::filesystem::path& directory,
                                   const std::string& device, std::ostream& out);

}  // namespace previz::truth
