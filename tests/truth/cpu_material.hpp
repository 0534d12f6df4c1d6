// Materials and textures of the scene at one point, for the reference tracer.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "daemon/core/scene/scene.hpp"
#include "tests/truth/cpu_bsdf.hpp"
#include "tests/truth/cpu_geometry.hpp"

namespace previz::truth {

Bsdf bsdf_at(const scene::Scene& scene, const MeshPoint& point, double specular_roughness);
// The shading normal after the normal texture, if the material has one; on the side of the winding.
glm::dvec3 normal_at(const scene::Scene& scene, const Geometry& geometry, const Hit& hit);
// That of the clear coat, which has a normal texture of its own or none.
glm::dvec3 clear_normal_at(const scene::Scene& scene, const Geometry& geometry, const Hit& hit);
// The direction in which the material's reflection is wider, in the world; 0 where the texture
// coordinates give none.
glm::dvec3 anisotropy_at(const scene::Scene& scene, const Geometry& geometry, const Hit& hit);
// The share of the surface that is there.
double coverage_at(const scene::Scene& scene, const MeshPoint& point);
glm::dvec3 emission_at(const scene::Scene& scene, const MeshPoint& point);

}  // namespace previz::truth
