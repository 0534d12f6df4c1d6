// Rendering as a stage: the composite of each shot, or its plate untouched where it cannot be made.
#pragma once

#include <functional>
#include <memory>

#include "daemon/lighting/response.hpp"
#include "daemon/pipeline/shot.hpp"
#include "daemon/render/renderer.hpp"
#include "daemon/scene/scene.hpp"
#include "daemon/set/set.hpp"

namespace previz::pipeline {

struct RenderStageOptions {
  bool layers = false;  // fill shot.layers (they cost a download)
  std::function<bool()> cancelled;
  std::function<void(const Shot&, int samples_done)> progress;  // a few times per frame
};

class RenderStage {
 public:
  RenderStage(std::shared_ptr<render::Device> device, const set::Set& set,
              const ObserverCalibration& calibration, const scene::Scene& scene,
              RenderStageOptions options);

  // Fills picture, layers, counters and untouched. Every frame uses the same random numbers (P8).
  void operator()(Shot& shot);

 private:
  void pass_through(Shot& shot, Plate plate, std::string reason) const;

  const set::Set set_;
  const ResponseCurve response_;
  const RenderStageOptions options_;
  render::Renderer renderer_;
  LightPtr light_;  // the one the renderer holds
};

}  // namespace previz::pipeline
