// Keeps a renderer for the live picture: makes it, makes it anew after it has failed or the
// graphics card was lost, and shows plates meanwhile. All but the construction happens on the
// render thread.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <stop_token>

#include "daemon/core/live/gpu_keeper.hpp"
#include "daemon/core/live/live_render.hpp"
#include "daemon/core/pipeline/channel.hpp"
#include "daemon/core/pipeline/render_stage.hpp"
#include "daemon/core/pipeline/shot.hpp"
#include "daemon/core/pipeline/stage_keeper.hpp"
#include "daemon/core/render/passes/pipelines_ahead.hpp"
#include "daemon/core/render/renderer.hpp"

namespace previz::live {

class LiveGraphics {
 public:
  struct Parts {  // outlive the graphics
    const set::Set& set;
    const scene::Scene& scene;
    std::shared_ptr<render::Device> device;
    std::shared_ptr<render::Renderer>& renderer;  // the set's before, then this one's; may be null
    LiveRender& render;
    pipeline::Mailbox<pipeline::Shot>& rendered;  // where plates go while there is no renderer
    pipeline::StageKeeper::Parts kept;
  };
  // Builds the renderer, unless the device is lost. Throws what keeps it from being built.
  LiveGraphics(Parts parts, const ObserverCalibration& calibration, std::stop_token stop);

  // Returns the next picture, or a plate where the renderer has failed; nothing at the end.
  std::optional<pipeline::Shot> next_picture();

 private:
  GpuKeeper::Gpu gpu();
  void make_stage();
  void drop_stage();
  void begin_ahead();
  void keep_programs();
  void begin_anew();
  void show_plates(std::chrono::milliseconds time);

  const Parts parts_;
  const ObserverCalibration calibration_;
  const std::stop_token stop_;
  std::optional<pipeline::RenderStage> stage_;
  GpuKeeper keeper_;
  pipeline::StageKeeper rendering_;
  int begun_anew_ = 0;      // renderers since the last picture, beside the first
  bool are_ahead_ = false;  // what ahead_ had to do is done and counted
  // Nothing where the device is the processor. It is gone before the device is opened again.
  std::optional<render::PipelinesAhead> ahead_;
};

}  // namespace previz::live
