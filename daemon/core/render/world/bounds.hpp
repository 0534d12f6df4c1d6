// This header computes the bounding spheres that directions and photons are aimed at
// (shaders/README.md, "Difference bounds" and "Caustics"), and the radius of what is lit.
#pragma once

#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "daemon/core/scene/bvh.hpp"
#include "daemon/core/scene/scene.hpp"

namespace previz::render {

// Each entry is the centre (world, metres) and the radius of one object. Past the first 16 objects
// the rest share one sphere, because every shading point tests all of them.
using Bounds = std::vector<glm::dvec4>;

// There is one sphere per instance, in world space; its radius is -1 where the instance has nothing
// to see.
using Spheres = std::vector<glm::dvec4>;
// Computes the spheres from scratch, which visits every triangle.
Spheres bounding_spheres(const scene::Scene& scene);
// Returns the spheres of the same instances at other places, without visiting a triangle. An
// instance that moved rigidly keeps its radius.
Spheres moved_spheres(const Spheres& spheres, const std::vector<scene::Instance>& before,
                      const std::vector<scene::Instance>& now);

// Returns the sphere around a box of the object's space.
glm::dvec4 bounding_sphere(const scene::Aabb& box, const glm::dmat4& world_from_object);

// Returns the spheres of objects that are in one world only.
Bounds difference_bounds(const scene::Scene& scene, const Spheres& spheres);

// Returns the spheres of objects that may reflect or refract light without blur: glass, metal and
// plastic whose GGX alpha is somewhere at or below `specular_alpha`, and glass that hardly
// refracts. Objects in neither world count too, so that the pipelines are ready when they return.
Bounds specular_bounds(const scene::Scene& scene, const Spheres& spheres, double specular_alpha);

// A lamp that shines from a place, or an object that emits.
struct Shining {
  glm::dvec4 sphere;  // around it; world, metres
  double power;       // W per channel, mean of the channels
};

// Returns the radius (metres) of the disc through which distant light counts beside what shines
// from a place. Each of these has a radius of its own, half the diagonal of the box around it and
// the objects that are in one world only; the result is their harmonic mean in squares, weighted by
// power, so that what brings little light counts little wherever it is. It is at most
// `scene_radius` (> 0), and half octaves below it, so that lights need not be weighed anew at every
// motion of an object. Where no object is in one world only, or nothing but distant light shines,
// it is `scene_radius`. `spheres` are those of the instances where they are now.
double lit_radius(const scene::Scene& scene, const Spheres& spheres,
                  std::span<const Shining> shining, double scene_radius);

}  // namespace previz::render
