// A tree over the lamps that have a place, by which a light sample finds those that matter where it
// is taken (shaders/README.md, "The tree of lamps").
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "daemon/core/render/world/gpu_lights.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

// One node of the order in which lamps are grouped. A LightShape lists them with the root first and
// each before its children, which stand beside each other.
struct LightBranch {
  std::uint32_t first;  // its first child; of a leaf: a lamp
  bool is_leaf;
};
using LightShape = std::vector<LightBranch>;

// Returns how to group the triangles of a mesh that emits; `lights` are these, where the mesh is
// not moved. It is empty if none shines.
LightShape shape_of_emitter(const PlacedLights& lights);

// The triangles of an emissive mesh, which keep their shape wherever the mesh is.
struct LightGroup {
  std::uint32_t first_light;
  const LightShape* shape;
};

struct LightTree {
  std::vector<gpu::GpuLightNode>
      nodes;               // the root first; one that nobody reads where there is none
  glm::dvec3 origin{0.0};  // from which the nodes' places count; world, metres
};

// Builds the tree of the first `lamps` lights and of the groups, and sets GpuLight::leaf of all
// lights. What has no place or no power is left out.
LightTree build_light_tree(PlacedLights& lights, std::size_t lamps,
                           std::span<const LightGroup> groups);

}  // namespace previz::render
