// Measures what colour the faces of a model have, from the plates under the light of the take.
#pragma once

#include <glm/vec3.hpp>
#include <iosfwd>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "daemon/core/output/progress.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/render/device/gpu.hpp"
#include "daemon/tools/calibrate/sensor/surface_pixels.hpp"
#include "daemon/tools/model/glb.hpp"
#include "daemon/tools/model/scan_mesh.hpp"

namespace previz::model {

// Diffuse albedo, linear Rec. 709, and its standard deviation.
struct Colour {
  glm::dvec3 albedo{0.5}, sigma{0};
  std::size_t pixels = 0;  // that it was measured in
};

// Compares models with a take that is read once, and shows how far that is.
class ColourComparison {
 public:
  // With `has_tags`, look_around() is part of what there is to do. Throws previz::Error if no frame
  // of the take is tracked and lit.
  ColourComparison(pipeline::Take take, std::shared_ptr<render::Device> device, bool has_tags,
                   std::ostream& out, bool terminal);

  const pipeline::Take& take() const { return take_; }
  // Returns the colour of every mesh that enough pixels show, by its name. The model is
  // rendered grey by the take's light, with all bounces, and each albedo is multiplied by what the
  // plates have over it, until it changes no more: the same comparison as `previz calibrate
  // balance`. The light is made to fit the paper of the set's tags first, so that it does not
  // matter whether the balance is in the set yet; without paper, lighting.balance is taken as
  // right.
  std::map<std::string, Colour> measure(const std::vector<NamedMesh>& meshes);
  // Renders the model in its colours by the take's light, large enough to see what is around tags,
  // and returns what it and the plates have in pixels that show one surface. What is rendered has
  // noise of its own: it is to be averaged.
  calibrate::SurfacePixels look_around(const std::vector<NamedMesh>& meshes,
                                       const Colours& colours);

 private:
  std::unique_ptr<calibrate::SurfaceProbe> probe(const scene::Scene& scene,
                                                 const calibrate::ProbeSize& size);
  void fit_to_paper(const scene::Scene& scene);
  void worked(double pixel_samples);

  const pipeline::Take take_;
  const std::shared_ptr<render::Device> device_;
  std::vector<calibrate::ProbedShot> shots_;
  const double rounds_work_;  // at most
  std::ostream& out_;
  output::ShareProgress progress_;
  std::string step_;
  double done_ = 0;
};

}  // namespace previz::model
