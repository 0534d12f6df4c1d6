// Bounding spheres of the objects towards which directions and photons are aimed.
#pragma once

#include <glm/vec4.hpp>
#include <vector>

#include "daemon/scene/scene.hpp"

namespace previz::render {

// Centre (world, metres) and radius, one an object; past the first 16 objects the rest share one,
// because every shading point looks at each.
using Bounds = std::vector<glm::dvec4>;

// Objects that are in one world only.
Bounds difference_bounds(const scene::Scene& scene);

// Objects on which light may be reflected or refracted without blur: glass, metal and plastic
// whose GGX alpha is somewhere at or below `specular_alpha`, and glass that hardly refracts.
Bounds specular_bounds(const scene::Scene& scene, double specular_alpha);

}  // namespace previz::render
