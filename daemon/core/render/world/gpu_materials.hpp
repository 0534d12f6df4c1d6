// Encodes materials for the shaders, with the albedo tables that rough and layered ones need.
#pragma once

#include <span>
#include <vector>

#include "daemon/core/scene/scene.hpp"
#include "shaders/lib/render_shared.h"

namespace previz::render {

struct EncodedMaterials {
  std::vector<gpu::GpuMaterial> materials;  // in the order given
  std::vector<float> albedo;                // the tables, which materials name by their place
};

// Surfaces are perfect mirrors where their GGX alpha is at most `specular_alpha`. Throws
// previz::Error where a material past gpu::MAX_MEDIUM tints the light inside it.
EncodedMaterials encode_materials(std::span<const scene::Material> materials,
                                  double specular_alpha);

}  // namespace previz::render
