// Holds a frame rate by choosing the number of samples and, where one sample is too much, a smaller
// picture. It is a pure controller: frame times go in, samples and size of the next frame come out.
#pragma once

namespace previz::pipeline {

// The cost of a frame is modelled as proportional to its pixels and samples, with a factor that
// follows the measured times: at once where a frame took longer, slowly where it was faster. The
// picture shrinks at once. It grows only when it could have twice the samples it needs, and not
// before `settle_frames` frames at its size, because a new size costs buffers and can be seen.
class Governor {
 public:
  static constexpr int most_samples = 50;  // P6: 1 to 50
  static constexpr double headroom = 0.9;  // planned share of a frame's time; the rest may vary
  static constexpr double least_scale = 0.125;
  static constexpr int settle_frames = 12;

  // `largest_scale` (0..1] is quality.scale; fps > 0.
  Governor(double fps, double largest_scale);

  int samples() const { return samples_; }
  double scale() const { return scale_; }  // of the observer's size; each step halves the pixels

  // Takes the time of a frame that was rendered with samples() at scale(). Ignores anything but a
  // positive number.
  void took(double seconds);

 private:
  double affordable(double scale) const;  // number of samples a frame

  const double budget_s_;
  const double largest_scale_;
  double cost_s_ = 0;  // one sample of the whole picture at full size; 0: not measured yet
  int samples_ = 1;
  double scale_;
  int at_this_scale_ = 0;  // number of frames so far
};

}  // namespace previz::pipeline
