// Rendering as a stage: the composite of each shot, or its plate untouched where it cannot be made.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "daemon/lighting/response.hpp"
#include "daemon/pipeline/shot.hpp"
#include "daemon/render/renderer.hpp"
#include "daemon/render/views.hpp"
#include "daemon/scene/scene.hpp"
#include "daemon/set/set.hpp"

namespace previz::pipeline {

struct RenderStageOptions {
  bool layers = false;  // fill shot.layers
  double scale = 1;     // of everything a shot gets, over the observer's size (preview_size.hpp)
  std::function<bool()> cancelled;
  std::function<void(const Shot&, int samples_done)> progress;  // a few times per frame
  std::function<void(const std::string&)> note;                 // anything worth a line, once
};

class RenderStage {
 public:
  // Keeps of the scene where things are and the lamps; the rest is the device's.
  RenderStage(std::shared_ptr<render::Device> device, const set::Set& set,
              const ObserverCalibration& calibration, const scene::Scene& scene,
              RenderStageOptions options);

  // Fills picture, layers, counters and untouched. Every frame uses the same random numbers (P8).
  // It is begin(), the samples of the set's quality, and finish().
  void operator()(Shot& shot);

  // The same in parts, for a frame that gets samples until somebody interrupts (P7).
  // False: the plate passes through untouched; the shot is then finished.
  bool begin(Shot& shot);
  // False: cancelled; the frame has then no samples and must be begun again.
  bool add_samples(int samples);
  void finish(Shot& shot);
  // Estimated from the samples of the last shot that was given layers, over the picture's rms; what
  // denoising then took away is not known well enough to be left out.
  double error() const { return error_; }

  // From the next begin() on. `scale` as in the options; costs new buffers, and no scene.
  void use(const set::Quality& quality) { set_.quality = quality; }
  void use(set::Estimator estimator) { renderer_.use(estimator); }
  void resize(double scale);
  // From the next finish() on.
  void show(render::View view) { view_ = view; }
  void fill_layers(bool layers) { options_.layers = layers; }

 private:
  bool cancelled() const { return options_.cancelled && options_.cancelled(); }
  double exposure_of(const Shot& shot) const;
  void place(const session::SceneState& state);
  PlatePtr sized_plate_of(Shot& shot);
  void pass_through(Shot& shot, PlatePtr plate, std::string reason) const;

  set::Set set_;
  const ObserverCalibration calibration_;       // at the observer's size
  std::optional<lighting::Response> response_;  // of the last plate's bits
  RenderStageOptions options_;
  render::View view_ = render::View::composite;
  render::Renderer renderer_;
  double error_ = 0;
  scene::Scene scene_;             // as in the set; instances and lamps only
  session::SceneState placed_;     // what the renderer holds
  LightPtr light_;                 // the one the renderer holds
  bool has_sources_ = false;       // lamps beside the scene\'s were ever set
  std::set<std::string> unknown_;  // names of recorded states that were told
};

}  // namespace previz::pipeline
