// Encodes lights in the layout that the shaders sample, with the probability of picking each
// (shaders/README.md, "Light" and "Direct light and its weights").
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/set.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

// Returns whether a light has an extent, so that rays can meet it: a rectangle, a sphere, or a
// directional light whose disc is wider than single precision can tell from a point.
bool can_be_seen(const set::Light& light);

// Returns whether the lamps and emissive triangles of a scene are more than gpu::FEW_LIGHTS, so
// that light samples choose them by a tree. An instance counts if it glows in one of its variants,
// and lamps found in the light around the set do not count: they come and go, and no pipeline is
// compiled for that.
bool are_many(const scene::Scene& scene);

// For each light the share of its light that passes its texture and alpha, on average over its
// area.
struct Weights {
  std::vector<double> values;  // empty: 1 for all
  double of(std::size_t light) const { return values.empty() ? 1 : values[light]; }
};

// Lights in the layout of the shaders, but for their places, which depend on the camera there.
struct PlacedLights {
  std::vector<gpu::GpuLight> lights;
  std::vector<glm::dvec3> positions;  // what becomes GpuLight::position; world, metres
  Weights weights;                    // one for each light
};

void append_lamp(PlacedLights& to, const set::Light& light);

// Appends one light per triangle of the mesh of an instance, in the mesh's order. `instance` is
// that of this index in the scene, or says where it is instead. `weights` are those of
// emission_weights(), and may be empty.
void append_emitter(PlacedLights& to, const scene::Scene& scene, std::uint32_t index,
                    const scene::Instance& instance, const std::vector<double>& weights);

// Returns the power that a light brings to a scene of this radius (metres), which matters for
// distant light only: W per channel, mean of the channels, with the largest of its gains.
double power_of(const gpu::GpuLight& light, double scene_radius);

// Returns what a lamp with a place sends along its brightest direction, as if it were a point
// (W/sr, mean of the channels), with the largest of its gains.
double intensity(const gpu::GpuLight& light);

// Fills `selection` and `cdf`: nine tenths by the power that a light brings to a scene of this
// radius (metres), one tenth evenly, nothing for black lights. Returns the sum of the powers (W per
// channel, mean of the channels).
double select_by_power(std::vector<gpu::GpuLight>& lights, double scene_radius,
                       const Weights& weights = {});

// Fills `rest_selection` and `rest_cdf` of lights that have a `selection` and a `leaf`, and returns
// the probability that a light sample takes the tree: a light outside the tree keeps its selection,
// those in it share nine tenths of theirs by the tree. It is 0 for a tree of less than two.
float select_by_tree(std::vector<gpu::GpuLight>& lights);

// Returns the solid angle that the lights' power comes from, over 2 pi, as
// EncodedEnvironment::spread; each light is taken to face the scene from a distance of one scene
// radius. Returns 2 where no light shines.
double spread_of(const std::vector<gpu::GpuLight>& lights, double scene_radius,
                 const Weights& weights = {});

}  // namespace previz::render
