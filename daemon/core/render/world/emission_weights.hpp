// Weighs the triangles of an emissive mesh by how much of their material's light they send, through
// texture and alpha, so that a light sample finds the bright parts of a wall of screens.
#pragma once

#include <vector>

#include "daemon/core/scene/scene.hpp"

namespace previz::render {

// Returns the mean of texture and alpha over each triangle of the instance's mesh, weighed by the
// emission's channels: over the nearest texels of up to 64 points, fewer where the triangle has
// fewer texels. No triangle counts less than a tenth of the mesh's mean, since a bright texel may
// lie between the points. Empty where every triangle sends all: there is neither texture nor alpha.
std::vector<double> emission_weights(const scene::Scene& scene, const scene::Instance& instance);

}  // namespace previz::render
