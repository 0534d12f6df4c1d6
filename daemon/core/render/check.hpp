// The renderer's part of `previzd check`.
#pragma once

#include <iosfwd>

#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::render {

// Prints the features that the set uses and those that are switched off, and estimates what a frame
// asks of the GPU without measuring it; `previz trade` measures.
void describe(const set::Set& set, const scene::Scene& scene, std::ostream& out);

// Says which device of this computer draws unless another is named, and what its graphics cards
// lack.
void describe_computer(std::ostream& out);

}  // namespace previz::render
