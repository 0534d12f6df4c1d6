// Times frames as the programs make them: from the captured frame to the picture that is shown, as
// `previzd run` does, or to all layers, as `previzd render` does.
#pragma once

#include <memory>

#include "daemon/pipeline/render_stage.hpp"
#include "daemon/trade/axes.hpp"
#include "daemon/trade/frame.hpp"

namespace previz::trade {

// How a frame is made, besides with which estimator and light.
struct Making {
  int samples = 1;
  double scale = 1;  // of the observer's size
  bool denoise = true;

  friend bool operator==(const Making&, const Making&) = default;
};

class PathTimer {
 public:
  PathTimer(const std::shared_ptr<render::Device>& device, TradeFrame& frame,
            const scene::Scene& scene, const TradeSettings& settings);

  // Both return seconds: the median of a few frames, after one that warms up. Tracking and the
  // screen have threads of their own and are not in it, nor is the writing of files.
  double live(const Making& making);
  double offline(const Making& making);

 private:
  double time(const Making& making, bool layers);

  pipeline::Shot shot_;
  const set::Quality quality_;
  pipeline::RenderStage stage_;
};

// What frames cost on the live path or offline, from a few of them. A frame's time is a fixed part,
// one for each pixel, one for denoising each pixel, and one for each sample of each pixel.
class PathCost {
 public:
  // Only live are pictures made smaller.
  PathCost(PathTimer& timer, bool is_live);

  double seconds(const Making& making) const;
  // Returns the largest number of samples that fit, or 0.
  int samples_within(double seconds, Making making) const;

 private:
  double per_sample_ = 0;              // of the whole picture
  double whole_ = 0;                   // fixed, of the whole picture
  double fixed_ = 0, per_pixels_ = 0;  // of smaller ones: the parts that pixels do not change
  double denoise_ = 0;                 // of the whole picture
};

}  // namespace previz::trade
