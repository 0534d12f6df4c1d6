// Bounding spheres of the objects towards which directions and photons are aimed.
#pragma once

#include <glm/vec4.hpp>
#include <vector>

#include "daemon/scene/scene.hpp"

namespace previz::render {

// Centre (world, metres) and radius, one an object; past the first 16 objects the rest share one,
// because every shading point looks at each.
using Bounds = std::vector<glm::dvec4>;

// One an instance, in world space; radius -1 where there is nothing to see.
using Spheres = std::vector<glm::dvec4>;
// Looks at every triangle.
Spheres bounding_spheres(const scene::Scene& scene);
// Those of the same instances elsewhere, as wide as before where they moved rigidly: no triangle is
// looked at.
Spheres moved_spheres(const Spheres& spheres, const std::vector<scene::Instance>& before,
                      const std::vector<scene::Instance>& now);

// Objects that are in one world only.
Bounds difference_bounds(const scene::Scene& scene, const Spheres& spheres);

// Objects on which light may be reflected or refracted without blur: glass, metal and plastic
// whose GGX alpha is somewhere at or below `specular_alpha`, and glass that hardly refracts. Those
// in no world count too: where a caustic can come, the pipelines are ready for it.
Bounds specular_bounds(const scene::Scene& scene, const Spheres& spheres, double specular_alpha);

}  // namespace previz::render
