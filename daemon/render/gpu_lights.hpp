// Encodes lights in the layout that the shaders sample: positions relative to the camera, powers,
// and the probability of picking each (shaders/README.md, "Light" and "Direct light and its
// weights").
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "daemon/scene/scene.hpp"
#include "daemon/set/set.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

// Returns whether a light has an extent, so that rays can meet it: a rectangle, a sphere, or a
// directional light whose disc is wider than single precision can tell from a point.
bool can_be_seen(const set::Light& light);

gpu::GpuLight encode_light(const set::Light& light, const glm::dvec3& camera_position);

// Returns one light per triangle of the mesh, in the mesh's order.
std::vector<gpu::GpuLight> encode_emitter(const scene::Instance& instance, const scene::Mesh& mesh,
                                          const scene::Material& material,
                                          const glm::dvec3& camera_position);

// Fills `selection` and `cdf`: nine tenths by the power that a light brings to a scene of this
// radius (metres), one tenth evenly, nothing for black lights. Returns the sum of the powers (W per
// channel, mean of the channels).
double select_by_power(std::vector<gpu::GpuLight>& lights, double scene_radius);

// Returns the solid angle that the lights' power comes from, over 2 pi, as
// EncodedEnvironment::spread; each light is taken to face the scene from a distance of one scene
// radius. Returns 2 where no light shines.
double spread_of(const std::vector<gpu::GpuLight>& lights, double scene_radius);

}  // namespace previz::render
