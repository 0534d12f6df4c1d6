// Rendering as a stage: the composite of each shot, or its plate untouched where it cannot be made.
#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "daemon/lighting/response.hpp"
#include "daemon/pipeline/shot.hpp"
#include "daemon/render/renderer.hpp"
#include "daemon/scene/scene.hpp"
#include "daemon/set/set.hpp"

namespace previz::pipeline {

struct RenderStageOptions {
  bool layers = false;  // fill shot.layers (they cost a download)
  double scale = 1;     // of everything a shot gets, over the observer's size (preview_size.hpp)
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
  Plate plate_of(const Frame& frame);
  void pass_through(Shot& shot, Plate plate, std::string reason) const;

  const set::Set set_;
  const ObserverCalibration calibration_;       // at the observer's size
  std::optional<lighting::Response> response_;  // of the last plate's bits
  const RenderStageOptions options_;
  render::Renderer renderer_;
  LightPtr light_;  // the one the renderer holds
};

}  // namespace previz::pipeline
