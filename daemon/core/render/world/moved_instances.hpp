// Finds the instances that have moved or changed between two frames, and the places around them.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "daemon/core/render/world/gpu_scene.hpp"
#include "daemon/core/render/world/light_change.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

struct MovedInstances {
  std::vector<gpu::GpuMoved> moved;  // at most 16, those that change most
  double rest = 0;             // the share by which the others, or what glows, may change any light
  double throws_caustics = 0;  // the largest share of what may reflect without blur
};

// Both in the same order; equal instances are left out. `camera` is the place in the world that
// spheres are relative to.
MovedInstances moved_instances(const std::vector<GpuScene::Stance>& before,
                               const std::vector<GpuScene::Stance>& now, const glm::dvec3& camera);

// Returns where light comes from, from infinity: the cells of the environment that have more than a
// thousandth of it, and directional lamps.
std::vector<gpu::GpuArrival> arrivals(const LightCells& environment,
                                      const std::vector<set::Light>& lamps);

}  // namespace previz::render
