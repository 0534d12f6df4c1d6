// Procedural meshes for tests and benchmarks.
#pragma once

#include <cstddef>

#include "daemon/core/scene/scene.hpp"
#include "drivers/calibration.hpp"

namespace previz::bench {

// A sphere of 20 * 4^levels triangles around the origin, closed and indexed, whose radius varies by
// up to `bumps` of itself.
scene::Mesh bumpy_sphere(int levels, double radius, double bumps, std::uint32_t seed);

// A square in the plane z = 0 around the origin, of cells * cells squares of two triangles.
scene::Mesh grid(float edge, int cells);

// A field of bumpy spheres of various sizes on a ground, of about so many triangles: one mesh.
scene::Mesh sphere_field(std::size_t triangles);

// Triangles with random corners in a cube of edge 2 `extent` and edges of about `size`.
scene::Mesh random_triangles(std::size_t count, float extent, float size, std::uint32_t seed);

scene::Scene scene_of(scene::Mesh mesh);

// The field of about so many triangles, real, and among it one virtual sphere; where a camera sees
// it from, and that camera.
scene::Scene field_with_a_virtual_sphere(std::size_t triangles);
glm::dmat4 view_of_field(const scene::Scene& scene);
ObserverCalibration camera_of(int width, int height);

// The same field as instances, one a sphere, of four meshes and the ground.
scene::Scene instanced_field(std::size_t triangles);

}  // namespace previz::bench
