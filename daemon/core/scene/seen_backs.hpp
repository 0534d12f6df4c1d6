// Finds meshes that are seen from behind. glTF 2.0, 3.9.6, culls the back of a material that is not
// doubleSided. previzd shows it, and says so of virtual objects: if only the camera did not see it,
// there would be the shadow and the reflection of nothing, and if no ray did, light would come into
// rooms through walls that are modelled one-sided. Other path tracers show it, too. A phantom
// stands for a thing that has a back.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "daemon/core/scene/scene.hpp"

namespace previz::scene {

// Returns for each of these meshes, which are one object, whether someone around them sees more of
// it from behind than an eighth: a sheet, a room from outside, a hull that is turned inside out,
// but no solid with a few holes. `tries` is how many triangles may still be tried, each by each
// ray, and is made less by those that were; where too few are left for an answer, none is seen.
std::vector<bool> are_seen_from_behind(std::span<const Mesh* const> meshes, std::uint64_t& tries);

}  // namespace previz::scene
