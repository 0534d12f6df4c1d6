// Samples pixels in which the film camera sees real, diffuse surfaces: the radiance that the camera
// saw and the radiance that the model predicts.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <string>
#include <vector>

#include "daemon/core/pipeline/light.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/pipeline/take.hpp"
#include "daemon/core/render/renderer.hpp"
#include "daemon/core/scene/scene.hpp"
#include "drivers/plate.hpp"

namespace previz::calibrate {

struct SurfacePixel {
  std::uint32_t surface = 0;  // index into SurfacePixels::surfaces
  std::uint32_t tile = 0;     // a sixteenth of one picture; pixels of a tile err together
  glm::dvec3 plate{0};        // linear Rec. 709 radiance of the camera's picture
  glm::dvec3 rendered{0};     // from the real world's model under the light camera's light
  std::uint32_t frame = 0;    // index into SurfacePixels::world_from_cameras
  glm::dvec2 px{0};           // its centre, in pixels of the film camera's picture
};

// Surfaces are materials, by the name that a set's [[surface]] gives them.
struct KnownSurface {
  std::string material;
  glm::dvec3 albedo{0};          // base colour factor, as the scene has it
  std::size_t least_pixels = 8;  // of a tile that counts
};

struct SurfacePixels {
  std::vector<KnownSurface> surfaces;
  std::vector<SurfacePixel> pixels;
  std::vector<glm::dmat4> world_from_cameras;  // of each frame that was looked at
  std::vector<std::string> notes;
};

// Adds the surfaces and pixels of `more`; tiles of the two are not the same ones.
void append(const SurfacePixels& more, SurfacePixels& to);

// A frame of a take with everything that a comparison needs of it.
struct ProbedShot {
  PlatePtr plate;
  double exposure = 1;
  glm::dmat4 world_from_camera{1};
  pipeline::LightPtr light;
};

// Visits the first frame with a pose and light of each of `count` equal shares of the take, and
// holds no plate beyond its visit. Throws previz::Error if there is none.
void each_probed_shot(const pipeline::Take& take, int count,
                      const std::function<void(ProbedShot)>& visit);

// Returns the set's estimation by which the real world is rendered whole, and no light at all.
set::Estimation paired(const set::Set& set);
lighting::EnvironmentMap darkness();

// Multiplies the light around the set by a factor for each channel.
void relight(std::vector<ProbedShot>& shots, const glm::dvec3& factors);

// The width of rendered pictures, and the samples by which each pixel's surface is found.
struct ProbeSize {
  int width = 160;
  int identity_samples = 16;
};

// Receives the number of samples that pixels got, a few times a second.
using PixelSamplesDone = std::function<void(double)>;

// Compares shots with the real world's model, once for each guess of its colours, with the same
// random numbers. Only the real world is rendered (no virtual object), at a fraction of the
// observer's size. A pass in the beginning finds which surface each pixel shows: surface k glows
// with (k, k^2, 1) and nothing else, so that a pixel's means show whether it covers one surface
// only. The pixels returned show one diffuse surface, as do their four neighbours, and no sample of
// the plate under them is black or white. Diffuse means opaque, no metal, nothing transmitted or
// emitted, and no coat smoother than roughness 0.5. Surfaces of the same material name are one
// surface.
class SurfaceProbe {
 public:
  // `take` must outlive this.
  SurfaceProbe(const pipeline::Take& take, const scene::Scene& scene,
               const std::shared_ptr<render::Device>& device, const ProbeSize& size,
               PixelSamplesDone done = {});

  // Finds the surfaces in a further shot, whose plate is not kept.
  void add(const ProbedShot& shot);
  // Puts another light in the place of the shots' own.
  void light_by(const pipeline::LightPtr& light);
  // Compares all shots. The scene is the constructor's, but for the colours of its diffuse
  // materials.
  SurfacePixels compare(const scene::Scene& scene, int samples);

 private:
  void add_pixels(const Plate& full, const ProbedShot& small,
                  const render::Sheet<glm::vec3>& identity);
  void render(render::Renderer& renderer, const ProbedShot& shot, int samples);

  const pipeline::Take& take_;
  const double scale_;
  const ObserverCalibration small_;
  const int identity_samples_;
  const PixelSamplesDone done_;
  std::vector<ProbedShot> shots_;  // their plates are scaled
  render::Renderer identity_, worlds_;
  SurfacePixels seen_;               // as yet without what is rendered
  std::vector<std::size_t> places_;  // of its pixels in their rendered pictures
};

}  // namespace previz::calibrate
