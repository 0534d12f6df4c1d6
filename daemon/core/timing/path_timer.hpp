// Times frames as the programs make them: from the captured frame to the picture that is shown, as
// `previzd run` does, or to all layers, as `previz render` does.
#pragma once

#include <array>
#include <functional>
#include <memory>

#include "daemon/core/pipeline/render_stage.hpp"
#include "daemon/core/timing/frame.hpp"

namespace previz::timing {

// How a frame is made, besides with which estimator and light.
struct Making {
  int samples = 1;
  double scale = 1;  // of the observer's size
  bool denoise = true;

  friend bool operator==(const Making&, const Making&) = default;
};

class PathTimer {
 public:
  // With `is_live` frames follow one another, and are averaged where the set's quality asks for it.
  PathTimer(const std::shared_ptr<render::Device>& device, TimedFrame& frame,
            const scene::Scene& scene, const FrameSettings& settings, bool is_live = false);

  // Both return seconds: the median of a few frames, or of one that takes long, after one of a
  // single sample that warms up. Tracking and the screen have threads of their own and are not in
  // it, nor is the writing of files.
  double live(const Making& making);
  double offline(const Making& making);

 private:
  double time(const Making& making, bool layers);
  double time_of_a_frame();

  pipeline::Shot shot_;
  const set::Quality quality_;
  pipeline::RenderStage stage_;
};

// What frames cost on the live path or offline, from a few of them. A frame's time is a fixed part,
// one for each pixel, one for denoising each pixel, and one for each sample of each pixel.
class PathCost {
 public:
  // Only live are pictures made smaller; frames of the whole size are then measured if one sample
  // of it fits `limit_s`, and otherwise follow from smaller ones.
  PathCost(PathTimer& timer, bool is_live, double limit_s);
  // From frames of a quarter of the size alone, by what `like` costs at that and at other sizes.
  PathCost(PathTimer& timer, bool is_live, const PathCost& like);
  // Everything that was measured, to be kept; in no stated order.
  using Parts = std::array<double, 8>;
  Parts parts() const {
    return {small_.fixed, small_.per_sample, small_.denoise, per_sample_, whole_,
            fixed_,       per_pixels_,       denoise_};
  }
  explicit PathCost(const Parts& parts)
      : small_{parts[0], parts[1], parts[2]},
        per_sample_(parts[3]),
        whole_(parts[4]),
        fixed_(parts[5]),
        per_pixels_(parts[6]),
        denoise_(parts[7]) {}
  // Makes the cost of known parts, all of the whole picture, in seconds.
  PathCost(double fixed_s, double per_sample_s, double denoise_s)
      : per_sample_(per_sample_s), whole_(fixed_s), per_pixels_(fixed_s), denoise_(denoise_s) {}

  double seconds(const Making& making) const;
  // Returns the largest number of samples that fit, or 0.
  int samples_within(double seconds, Making making) const;

 private:
  // Parts of a frame of a quarter of the size, in seconds.
  struct Small {
    double fixed = 0, per_sample = 0, denoise = 0;
  };
  static Small measure_small(const std::function<double(const Making&)>& time);
  void measure_live(const std::function<double(const Making&)>& time, double limit_s);
  void measure_whole(const std::function<double(const Making&)>& time);

  Small small_;
  double per_sample_ = 0;              // of the whole picture
  double whole_ = 0;                   // fixed, of the whole picture
  double fixed_ = 0, per_pixels_ = 0;  // of smaller ones: the parts that pixels do not change
  double denoise_ = 0;                 // of the whole picture
};

}  // namespace previz::timing
