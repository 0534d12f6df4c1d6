// Holds a frame rate by choosing samples and size of the preview, and whether it is denoised. It is
// a pure controller: frame times go in, the settings of the next frame come out.
#pragma once

#include <vector>

#include "daemon/core/pipeline/frame_cost.hpp"
#include "daemon/core/set/set.hpp"

namespace previz::pipeline {

// Returns what the preview may do to hold its rate, best first: the set's own [[quality.preview]]
// tables, or, without any, the picture at quality.scale and then each time half as many pixels,
// down to Governor::least_scale, all with a sample at least.
std::vector<set::PreviewStep> preview_steps(const set::Quality& quality);

// Of the steps, the first whose least samples fit is taken, with as many samples as fit. A frame
// fits if its 99th percentile is within the frame's time, and if it takes no more than `headroom`
// of that time as expected. What a frame costs is learned (frame_cost.hpp), the fixed part for each
// step on its own. One more sample, or a step that was not tried yet, is tried where it may fit by
// what is not known. Frames that are all alike teach nothing of the parts: now and then one has
// fewer samples, or, where there is but the least number, one more, for which at most one frame in
// a hundred is late.
//
// Samples follow at once where a frame took longer. The size follows when a second frame says so,
// because it can be seen. A better step comes back after `settle_frames` frames at one step, and
// after twice as many each time that it had to be left again soon. Where no step fits, that one is
// used whose smaller picture still buys time: each halving of the pixels must save 16 % of the
// frame's.
class Governor {
 public:
  static constexpr int most_samples = 50;  // P6: 1 to 50
  static constexpr double headroom = 0.9;  // planned share of a frame's time; the rest may vary
  static constexpr double least_scale = 0.125;
  static constexpr int settle_frames = 12;

  // fps > 0; there is at least one step.
  Governor(double fps, std::vector<set::PreviewStep> steps);
  // Takes the default steps from `largest_scale` (0..1] on.
  Governor(double fps, double largest_scale);

  int samples() const { return samples_; }
  double scale() const { return step().scale; }  // of the observer's size
  const set::PreviewStep& step() const { return steps_[at_].step; }

  // Takes the time of a frame that was rendered with samples() and step(). Ignores anything but a
  // positive number.
  void took(double seconds);

  const FrameCost& cost() const { return cost_; }
  // Returns the time that a frame is planned to take.
  double planned_s() const;

 private:
  struct Step {
    set::PreviewStep step;
    double pixels = 1;  // as a share of the observer's
    bool known = false;
    // A frame of this step, as expected when it was left.
    double work = 0, seconds = 0;
  };

  double work(const Step& step, int samples) const { return samples * step.pixels; }
  double drift() const;
  double fixed_of(std::size_t step) const;
  double least_seconds(std::size_t step) const;
  bool is_hopeless(std::size_t step) const;
  std::size_t choose_step() const;
  std::size_t least_bad() const;
  void go_to(std::size_t step);
  int choose_samples() const;
  int vary(int samples);

  const double frame_s_;
  std::vector<Step> steps_;
  FrameCost cost_;
  std::size_t at_ = 0;
  int samples_ = 1;
  int usual_ =
      1;  // the samples that fit; those of a single frame may be others, so that it teaches
  int frames_ = 0;            // since the start, or since costs changed
  int frames_here_ = 0;       // at this step
  int hold_ = settle_frames;  // frames at a step before a better one is tried
  bool rose_ = false;         // to this step, from a worse one
  int alike_ = 0;             // frames since the last of other samples
  int since_risk_ = 0;        // frames since one was risked that may be late
  // A frame soon after this step was gone to, and what it costs now: their ratio is how costs have
  // drifted meanwhile.
  double entry_work_ = 0, entry_seconds_ = 0;
};

}  // namespace previz::pipeline
