// Scenes of a few triangles and cameras of one pixel, for tests with closed-form answers.
#pragma once

#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>

#include "daemon/lighting/environment.hpp"
#include "daemon/scene/scene.hpp"
#include "drivers/calibration.hpp"

namespace previz::truth {

// Adds a parallelogram around `centre` that faces cross(half_u, half_v); returns its instance.
std::size_t add_quad(scene::Scene& scene, const glm::vec3& centre, const glm::vec3& half_u,
                     const glm::vec3& half_v, const scene::Material& material);
// Adds a sphere of smooth normals with 2 * n * n triangles and uvs; returns its instance.
std::size_t add_sphere(scene::Scene& scene, const glm::vec3& centre, float radius, int n,
                       const scene::Material& material);

scene::Material lambert(const glm::vec3& albedo);
scene::Material metal(const glm::vec3& f0, float roughness);
scene::Material plastic(const glm::vec3& base_color, float roughness);
scene::Material glass(float ior);
scene::Material emitter(const glm::vec3& radiance);

lighting::EnvironmentMap constant_environment(const glm::vec3& radiance, int size = 4);

// One pixel, field of view 1e-4 rad.
ObserverCalibration one_pixel();
ObserverCalibration pinhole(int width, int height, double focal_px);
// Looks from `eye` at `target`; the picture's up is near world Z (or Y when looking along Z).
glm::dmat4 look_at(const glm::dvec3& eye, const glm::dvec3& target);

}  // namespace previz::truth
