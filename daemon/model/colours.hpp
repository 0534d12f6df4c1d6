// Measures what colour the faces of a model have, from the plates under the light of the take.
#pragma once

#include <glm/vec3.hpp>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "daemon/calibrate/sensor/surface_pixels.hpp"
#include "daemon/model/glb.hpp"
#include "daemon/model/scan_mesh.hpp"
#include "daemon/pipeline/take.hpp"
#include "daemon/render/gpu.hpp"

namespace previz::model {

// Diffuse albedo, linear Rec. 709, and its standard deviation.
struct Colour {
  glm::dvec3 albedo{0.5}, sigma{0};
  std::size_t pixels = 0;  // that it was measured in
};

// Returns the colour of every mesh that enough pixels show, by its name. The model is
// rendered grey by the take's light, with all bounces, and each albedo is multiplied by what the
// plates have over it, until it changes no more: the same comparison as `previzd calibrate
// balance`, whose result, lighting.balance, is taken as right. Throws previz::Error if no frame of
// the take is tracked and lit.
std::map<std::string, Colour> measure_colours(const pipeline::Take& take,
                                              const std::vector<NamedMesh>& meshes,
                                              const std::shared_ptr<render::Device>& device);

// Renders the model in its colours by the take's light, `width` pixels across, and returns what it
// and the plates have in pixels that show one surface. Throws as measure_colours().
calibrate::SurfacePixels compare_surfaces(const pipeline::Take& take,
                                          const std::vector<NamedMesh>& meshes,
                                          const Colours& colours, int width,
                                          const std::shared_ptr<render::Device>& device);

}  // namespace previz::model
