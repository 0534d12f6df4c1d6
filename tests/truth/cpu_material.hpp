// Materials and textures of the scene at one point, for the reference tracer.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "daemon/scene/scene.hpp"
#include "tests/truth/cpu_bsdf.hpp"

namespace previz::truth {

Bsdf bsdf_at(const scene::Scene& scene, std::uint32_t instance, const glm::dvec2& uv,
             double specular_roughness);
glm::dvec3 emission_at(const scene::Scene& scene, std::uint32_t instance, const glm::dvec2& uv);

}  // namespace previz::truth
