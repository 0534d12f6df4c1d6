// The render stage makes the composite of each shot, or passes its plate through untouched where
// that is not possible.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "daemon/core/lighting/response.hpp"
#include "daemon/core/pipeline/light_figure.hpp"
#include "daemon/core/pipeline/relight.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/render/picture/views.hpp"
#include "daemon/core/render/renderer.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::pipeline {

struct RenderStageOptions {
  bool layers = false;  // fill shot.layers
  // Renders in place of a new one; what of its scene the set has too is kept. May be null.
  std::shared_ptr<render::Renderer> renderer = {};
  // Shots that are rendered as a whole follow one another on a display: they are dithered
  // (render::FrameInput), and averaged where the set's quality asks for it. Otherwise every shot
  // stands alone.
  bool is_live = false;
  // Every shot has random numbers of its own, by the set's seed and its index in the take, so that
  // it can be averaged with its neighbours (keep()); otherwise all have the same.
  bool seeds_shots = false;
  // Size of what is rendered over the observer's size (preview_size.hpp). So large are a shot's
  // layers and, unless it is live, its picture. The composite that is shown live has the observer's
  // size, and the plate in it is as sharp as it was.
  double scale = 1;
  // A frame of another size than the calibration's passes through untouched, as from a camera that
  // was exchanged; otherwise it is an error, as in a take, all of whose frames would be like it.
  bool passes_other_sizes = false;
  std::function<bool()> cancelled;
  std::function<void(const Shot&, int samples_done)> progress;  // a few times per frame
  std::function<void(const std::string&)> note;                 // each message once
  // Only these samples of a shot are rendered, and it gets their sums in place of a picture
  // (render_range()). The set must have has_fixed_samples(), and shots are neither live nor kept.
  std::optional<render::SampleRange> sample_range = {};
  // Returns the sums of all samples of a shot, which were rendered elsewhere with its settings and
  // become its picture; nothing where they cannot be had, and the shot is then not whole. Null: the
  // samples are rendered here.
  std::function<std::optional<render::SampleSums>(const Shot&)> sums = {};
};

// A shot that is being rendered.
struct ShotUnderWay {
  Shot shot;
  std::optional<render::Showing> showing;  // none: the shot is finished as it is
  std::chrono::steady_clock::time_point begin;

  bool is_here() const { return !showing || showing->is_here(); }
};

class RenderStage {
 public:
  // Keeps only the instances and lamps of the scene and what moves them; the rest goes to the
  // device.
  RenderStage(std::shared_ptr<render::Device> device, const set::Set& set,
              const ObserverCalibration& calibration, const scene::Scene& scene,
              RenderStageOptions options);

  // Fills picture, layers, counters and untouched. Every frame uses the same random numbers (P8),
  // unless frames are averaged, live or with their neighbours.
  // This is begin(), the samples that the set's quality asks for, and finish(). Where every pixel
  // gets the same number and the stage is not live, they are summed in parts (render_range()).
  void operator()(Shot& shot);
  // The same in two parts, between which the next shot can be started: the device goes on with that
  // one while the computer has the first one's picture. Shots are finished in the order in which
  // they were started, and before the stage goes. The picture goes where it is wanted, as far as it
  // is the composite alone; others come down.
  ShotUnderWay start(Shot shot, const render::ShowTo& to = {});
  Shot finish(ShotUnderWay under_way) const;

  // keep() and show_among() do the same in two parts, for shots of a take that are averaged with
  // their neighbours. keep() is begin() and the samples; a shot that it finishes (it is untouched)
  // or that was cancelled (it is not whole) has no frame: null. show_among() makes the shot's
  // picture, and its layers, from the chain of kept frames (Renderer::show_among), the last of
  // which is its own.
  render::KeptFramePtr keep(Shot& shot);
  void show_among(Shot& shot, const std::vector<render::KeptFramePtr>& chain);

  // begin(), add_samples() and finish() do the same in parts, for a frame that gets samples until
  // somebody interrupts (P7). begin() returns false if the plate passes through untouched; the shot
  // is then finished.
  bool begin(Shot& shot);
  // Returns false if it was cancelled; the frame then has no samples and must be begun again.
  bool add_samples(int samples);
  void finish(Shot& shot);
  // Returns the error over the picture's rms, estimated from the samples of the last shot that was
  // given layers. The noise that denoising then took away is included, because its amount is not
  // known well enough.
  double error() const { return error_; }

  // Returns what renders, to be used by the stage of another set once this one has ended.
  const std::shared_ptr<render::Renderer>& renderer() const { return renderer_; }

  // Renders a tracked and lit shot small, between two live ones, in which it changes nothing, and
  // compares the model of what is real with its plate.
  void compare_light(Shot shot, LightComparison& comparison);

  // use() and resize() take effect with the next begin(). `scale` is as in the options; only
  // one that is larger than all before it costs new buffers.
  void use(const set::Quality& quality) { set_.quality = quality; }
  void use(set::Estimator estimator) { renderer_->use(estimator); }
  void resize(double scale);
  // show() and fill_layers() take effect with the next finish().
  void show(render::View view) { view_ = view; }
  void fill_layers(bool layers) { options_.layers = layers; }

 private:
  bool begin(Shot& shot, bool is_live);
  bool sample(Shot& shot);
  bool put_sums(Shot& shot);
  void take_sums(Shot& shot);
  bool cancelled() const { return options_.cancelled && options_.cancelled(); }
  double exposure_of(const Shot& shot) const;
  void light(const Shot& shot);
  void place(const session::SceneState& state);
  std::optional<std::string> why_other_size(const Frame& frame) const;
  PlatePtr sized(Shot& shot) const;
  void pass_through(Shot& shot, PlatePtr plate, std::string reason) const;

  set::Set set_;
  const ObserverCalibration calibration_;       // at the observer's size
  std::optional<lighting::Response> response_;  // for the last plate's bit depth
  RenderStageOptions options_;
  const std::shared_ptr<render::Scratch> scratch_;  // the device's, if there is one
  render::View view_ = render::View::composite;
  std::shared_ptr<render::Renderer> renderer_;  // never null
  double error_ = 0;
  scene::Scene scene_;          // as in the set; what place() needs of it
  session::SceneState placed_;  // what the renderer holds
  LightPtr light_;              // the one the renderer holds
  LampStates relit_;            // the changes of lamps that the renderer holds beside the scene's
  std::set<std::string> unmatched_;  // names in relit_ of which the light has no lamp
  bool has_sources_ = false;         // lamps beside the scene's were ever set
  bool is_measured_anew_ = false;    // lamps in scene_ have another emission than the renderer's
  bool stands_elsewhere_ = false;    // instances and lamps are as in another shot: show_among()
  std::set<std::string> unknown_;    // names in recorded states that were already reported
};

}  // namespace previz::pipeline
