// Renders one frame with one method of a trade's plan, and times it.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "daemon/core/render/renderer.hpp"
#include "daemon/core/scene/scene.hpp"
#include "daemon/core/timing/frame.hpp"
#include "daemon/tools/trade/axes.hpp"
#include "daemon/tools/trade/measure.hpp"

namespace previz::trade {

class MethodRenderer {
 public:
  // `sweep_scale` is relative to the observer's size; the settings' scale is relative to the
  // sweep's size, which every picture() has.
  MethodRenderer(const std::shared_ptr<render::Device>& device, timing::TimedFrame& frame,
                 const scene::Scene& scene, const timing::FrameSettings& settings,
                 double sweep_scale);

  // Renders one sample, so that the device compiles its pipelines, which happens at their first
  // use.
  void warm_up();
  // Begins the frame anew, without samples.
  void begin(std::uint32_t seed);
  // Renders all samples of the frame begun, as the settings spread them, then denoises if the
  // settings say so. Returns the time in seconds.
  double render(int samples);
  // Adds samples to every pixel; layers() and picture() then return the plain result.
  void add(int samples);

  // Returns the FEATURE_* bits of the frame begun.
  std::uint32_t needed() const { return renderer_.needed(); }
  const render::Layers& layers() const { return layers_; }
  TradePicture picture() const;
  // Returns what denoising makes of the samples so far.
  TradePicture denoised_picture();

 private:
  TradePicture made(const render::Layers& layers) const;

  const double exposure_;
  const glm::dmat4 world_from_camera_;
  const bool adaptive_, denoise_;
  const PlatePtr plate_, whole_;        // at the size of the rendering, and of the sweep
  const render::PlateRadiance camera_;  // of the whole plate
  std::vector<float> radiance_of_;      // samples
  render::Renderer renderer_;
  render::Layers layers_;
};

}  // namespace previz::trade
