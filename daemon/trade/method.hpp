// One frame rendered with one method of a trade's plan, and timed.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "daemon/render/renderer.hpp"
#include "daemon/scene/scene.hpp"
#include "daemon/trade/axes.hpp"
#include "daemon/trade/frame.hpp"
#include "daemon/trade/measure.hpp"

namespace previz::trade {

class MethodRenderer {
 public:
  // `sweep_scale`: of the observer's size; the settings' scale is of that.
  MethodRenderer(const std::shared_ptr<render::Device>& device, TradeFrame& frame,
                 const scene::Scene& scene, const TradeSettings& settings, double sweep_scale);

  // A first sample makes the device ready: its pipelines are compiled when they are first used.
  void warm_up();
  // Forgets what was rendered.
  void begin(std::uint32_t seed);
  // All the samples of a frame begun, as the settings spread them, and what they do to the picture
  // then. Seconds.
  double render(int samples);
  // Some more for every pixel, of which layers() and picture() then are as they came.
  void add(int samples);

  // FEATURE_* bits of the frame begun.
  std::uint32_t needed() const { return renderer_.needed(); }
  const render::Layers& layers() const { return layers_; }
  TradePicture picture() const;

 private:
  const double exposure_;
  const glm::dmat4 world_from_camera_;
  const bool adaptive_, denoise_;
  const PlatePtr plate_;
  const std::vector<double> camera_;  // the plate's radiance, interleaved RGB
  render::Renderer renderer_;
  render::Layers layers_;
};

}  // namespace previz::trade
