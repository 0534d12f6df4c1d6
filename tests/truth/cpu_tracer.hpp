// The reference path tracer the renderer is tested against: one world at a time, on the CPU, the
// simplest possible code. It shares no code with the renderer; README.md states the model.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "daemon/core/lighting/environment.hpp"
#include "daemon/core/scene/scene.hpp"
#include "drivers/calibration.hpp"

namespace previz::truth {

struct TraceOptions {
  int max_depth = 16;                // surface vertices after the camera
  double specular_roughness = 1e-3;  // alpha at or below which a lobe is a Dirac delta
  // false: drop light that reaches a diffuse or rough vertex only by way of Dirac lobes (what
  // photons would deliver).
  bool caustics = true;
};

// Row-major. Linear Rec. 709 radiance.
struct TracedPicture {
  std::vector<glm::dvec3> mean;
  std::vector<glm::dvec3> standard_error;  // of the mean, from the samples' own variance
  std::vector<double> mask;   // share of samples whose first hit of either world is not in both
  std::vector<double> depth;  // along the optical axis, mean over hits in this world; 0: no hit
};

class CpuTracer {
 public:
  // The scene and the map must outlive the tracer.
  CpuTracer(const scene::Scene& scene, const lighting::EnvironmentMap& environment,
            const TraceOptions& options = {});
  ~CpuTracer();

  // `world` is scene::world_mixed or scene::world_real. Two threads; the result depends only on
  // the arguments.
  TracedPicture trace(const ObserverCalibration& calibration, const glm::dmat4& world_from_camera,
                      std::uint32_t world, int samples, std::uint64_t seed);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace previz::truth
