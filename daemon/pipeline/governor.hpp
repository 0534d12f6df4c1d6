// Holds a frame rate by samples, and where one sample is too much, by a smaller picture. A pure
// controller: what frames took goes in, what the next one may take comes out.
#pragma once

namespace previz::pipeline {

// Takes the cost of a frame as proportional to its pixels and samples, with a factor that follows
// what was measured: at once where a frame took longer, slowly where it was faster. The picture
// shrinks at once and grows only when it could have twice the samples it needs, and not before
// `settle_frames` frames at its size: a new size costs buffers, and is seen.
class Governor {
 public:
  static constexpr int most_samples = 50;  // P6: 1 to 50
  static constexpr double headroom = 0.9;  // of a frame's time; the rest is for what varies
  static constexpr double least_scale = 0.125;
  static constexpr int settle_frames = 12;

  // `largest_scale` (0..1] is quality.scale; fps > 0.
  Governor(double fps, double largest_scale);

  int samples() const { return samples_; }
  double scale() const { return scale_; }  // of the observer's size; each step halves the pixels

  // What the frame with these samples at this scale took. Ignores what is no positive number.
  void took(double seconds);

 private:
  double affordable(double scale) const;  // samples a frame

  const double budget_s_;
  const double largest_scale_;
  double cost_s_ = 0;  // of a sample at full size; 0: not measured yet
  int samples_ = 1;
  double scale_;
  int at_this_scale_ = 0;  // frames
};

}  // namespace previz::pipeline
