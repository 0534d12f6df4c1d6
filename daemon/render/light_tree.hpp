// A tree over the lamps that have a place, by which a light sample finds those that matter where it
// is taken (shaders/README.md, "The tree of lamps").
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "daemon/render/gpu_lights.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

struct LightTree {
  std::vector<gpu::GpuLightNode>
      nodes;               // the root first; one that nobody reads where there is none
  glm::dvec3 origin{0.0};  // from which the nodes' places count
};

// Builds the tree of the lamps with a place and a power, and sets GpuLight::leaf of all lights.
LightTree build_light_tree(std::vector<gpu::GpuLight>& lights, const Weights& weights);

}  // namespace previz::render
